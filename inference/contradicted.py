"""Ranges that rest on numbers of a scene which its empty frames contradict."""

import dataclasses

import numpy as np

from inference.estimates import TechniqueResult
from inference.fits.answer.withheld import without_ranges
from inference.realtime.nearest_roots import nearest

__all__ = ["CONTRADICTED", "without_moved"]

CONTRADICTED = (
    "the empty frames contradict the scene by light that moves this range by more than its "
    "standard deviation (see assumptions)"
)
_CONTRADICTED_PARAMETER = "the empty frames contradict the scene (see assumptions)"


def without_moved(result: TechniqueResult, other: TechniqueResult | None) -> TechniqueResult:
    """Return a result without the ranges that light moves which the scene does not state.

    Parameters
    ----------
    result : TechniqueResult
        Of n frames.
    other : TechniqueResult or None
        The same without that light; None where there is no answer then.

    Returns
    -------
    TechniqueResult
        Frames of which a root moves by more than its standard deviation, or goes, have the status
        ``none`` and the reason; so have those of roots without a standard deviation. No parameter
        is identified then.
    """
    if other is None:
        return _unidentified(without_ranges(result, CONTRADICTED))
    away = np.abs(result.roots_m - nearest(result.roots_m, other.roots_m))
    with np.errstate(invalid="ignore"):
        stays = (away <= result.roots_sd_m) | np.isnan(result.roots_m)
    moved = ~stays.all(axis=1) | (result.root_count != other.root_count)
    if not moved.any():
        return result
    return _unidentified(without_ranges(result, CONTRADICTED, moved))


def _unidentified(result: TechniqueResult) -> TechniqueResult:
    """Return a result that has identified nothing: its parameters rest on the same numbers."""
    if result.parameters is None:
        return result
    state = {"status": "not_identified", "reason": _CONTRADICTED_PARAMETER}
    told = {path: {**entry, **state} for path, entry in result.parameters.items()}
    return dataclasses.replace(result, parameters=told)
