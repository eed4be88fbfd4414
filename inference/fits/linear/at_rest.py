"""Whether ranges of single frames differ by more than their own noise."""

import math

import numpy as np

from inference.estimates import TechniqueResult
from inference.fits.linear.least_squares import LinearFit
from simulator.errors import RefusedError, listed

__all__ = ["refuse_at_rest"]

_STILL = 4.0  # variance of the ranges over that of their noise up to which an object is at rest


def refuse_at_rest(fit: LinearFit, single: TechniqueResult, unknowns: tuple[str, ...]) -> None:
    """Refuse where the ranges differ by no more than their own noise.

    They are regressed on: where their differences are noise, what follows from them is noise too,
    and surer of itself the more frames there are. Of a still object `_STILL` is exceeded in at
    most 1e-3 of sets of four frames or more.

    Parameters
    ----------
    single : TechniqueResult
        Ranges of single frames, of which the fit has chosen.
    unknowns : tuple of str
        What is fitted.

    Raises
    ------
    RefusedError
        There, with the remedy; never for one unknown, which one range tells.
    """
    if len(unknowns) < 2:
        return
    r = fit.ranges[fit.used]
    roots, sds = single.roots_m[fit.used], single.roots_sd_m[fit.used]
    chosen = np.nanargmin(np.abs(roots - r[:, None]), axis=1)
    own = float(np.nanmedian(sds[np.arange(r.size), chosen] / r)) ** 2
    between = float(np.var(np.log(r)))
    if not between > _STILL * own:
        raise RefusedError(
            "the object hardly moves: the ranges of single frames differ by "
            f"{math.sqrt(between):.2g} of themselves and are uncertain by {math.sqrt(own):.2g}; "
            f"{listed(list(unknowns))} need distinct ranges; move the object nearer and farther, "
            f"or state {'one' if len(unknowns) == 2 else len(unknowns) - 1} of them as known"
        )
