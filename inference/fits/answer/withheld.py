"""Ranges of single frames that a fit over all of them contradicts."""

import dataclasses

import numpy as np

from inference.estimates import SdParts, Status, TechniqueResult
from inference.fits.answer.ranges import MISFIT

__all__ = ["without_ranges"]


def without_ranges(result: TechniqueResult) -> TechniqueResult:
    """Return a result that gives no ranges, for the fit does not explain the frames.

    Parameters
    ----------
    result : TechniqueResult
        Of n frames, as a technique of single frames gives it.

    Returns
    -------
    TechniqueResult
        Frames that had roots have the status ``none`` and the reason; the others keep theirs.
    """
    had = result.root_count > 0
    nothing = np.full((len(result), 1), np.nan)
    return dataclasses.replace(
        result,
        status=np.where(had, Status.NONE, result.status).astype(np.uint8),
        roots_m=nothing,
        roots_sd_m=nothing,
        root_count=np.zeros_like(result.root_count),
        near_fold=np.zeros_like(result.near_fold),
        reason=np.where(had, len(result.reasons), result.reason).astype(np.uint8),
        reasons=(*result.reasons, MISFIT),
        sd_parts_m=SdParts(nothing, nothing, nothing),
        range_bounds_m=None,
        power_law=None,
        power_law_sd=None,
        zeta=None,
        zeta_sd=None,
    )
