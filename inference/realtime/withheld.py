"""Ranges of single frames that something else contradicts: they are not given, and why."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult
from inference.realtime.nearest_roots import nearest

__all__ = ["CONTRADICTED", "without_moved", "without_ranges"]

Array = NDArray[np.float64]

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


def without_ranges(
    result: TechniqueResult, reason: str, where: NDArray[np.bool_] | None = None
) -> TechniqueResult:
    """Return a result that gives no ranges of some frames.

    Parameters
    ----------
    result : TechniqueResult
        Of n frames.
    reason : str
        Why.
    where : ndarray of bool, shape (n,), optional
        Which frames; left out, all.

    Returns
    -------
    TechniqueResult
        Those that had roots have the status ``none`` and the reason; the others keep theirs.
    """
    had = result.root_count > 0
    if where is not None:
        had = had & where

    def blank(values: Array) -> Array:
        return np.where(had.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values)

    def blanked(values: Array | None) -> Array | None:
        return None if values is None or where is None else blank(values)

    parts = result.sd_parts_m
    return dataclasses.replace(
        result,
        status=np.where(had, Status.NONE, result.status).astype(np.uint8),
        roots_m=blank(result.roots_m),
        roots_sd_m=blank(result.roots_sd_m),
        root_count=np.where(had, 0, result.root_count),
        near_fold=result.near_fold & ~had,
        reason=np.where(had, len(result.reasons), result.reason).astype(np.uint8),
        reasons=(*result.reasons, reason),
        sd_parts_m=None if parts is None else SdParts(*(blank(part) for part in parts)),
        range_bounds_m=blanked(result.range_bounds_m),
        power_law=blanked(result.power_law),
        power_law_sd=blanked(result.power_law_sd),
        zeta=blanked(result.zeta),
        zeta_sd=blanked(result.zeta_sd),
    )
