"""Ranges that something else contradicts: they are not given, and why."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult

__all__ = ["without_ranges"]

Array = NDArray[np.float64]


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
