"""What to give instead of columns that other software has for readings."""

import re

__all__ = ["instead_of"]

_POLAR = "a sine wave has i = amplitude cos(phase) and q = amplitude sin(phase), the phase in rad"
_RANGE = "ranges are what is answered; one that is known beforehand is known_range_m"
_INSTEAD = {
    "phase": _POLAR,
    "phi": _POLAR,
    "amplitude": _POLAR,
    "amp": _POLAR,
    "magnitude": _POLAR,
    "distance": _RANGE,
    "range": _RANGE,
}


def instead_of(name: str) -> str:
    """Return what to give instead of a column, empty where nothing is known of its name.

    Parameters
    ----------
    name : str
        As it was given; case and a unit at its end do not count.
    """
    return _INSTEAD.get(re.sub(r"_(m|mm|rad|deg)$", "", name.lower()), "")
