"""A range whose error is no number says why."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status, TechniqueResult

__all__ = ["BESIDE_FOLD", "NO_NUMBER", "explained"]

BESIDE_FOLD = (
    "noise, or what the scene leaves open, could merge this range with another or remove it: an "
    "error bar of first order means nothing here"
)
NO_NUMBER = "the error of this range is no number"

_PIECE = 4096  # frames looked at together


def explained(result: TechniqueResult) -> TechniqueResult:
    """Return a result whose unique ranges without a standard deviation have a reason.

    Parameters
    ----------
    result : TechniqueResult
        Of n frames.

    Returns
    -------
    TechniqueResult
        It itself where every such range says why already, as light does that may be none.
    """
    # piece by piece, for many frames fill the memory
    pieces = [slice(i, i + _PIECE) for i in range(0, len(result), _PIECE)]
    found = [part.start + rows for part in pieces if (rows := _unsaid(result, part)).size]
    if not found:
        return result
    unsaid, said = np.concatenate(found), result.reason.copy()
    fold = len(result.reasons)
    said[unsaid] = np.where(result.near_fold[unsaid], fold, fold + 1)
    reasons = (*result.reasons, BESIDE_FOLD, NO_NUMBER)
    return dataclasses.replace(result, reason=said, reasons=reasons)


def _unsaid(result: TechniqueResult, part: slice) -> NDArray[np.intp]:
    """Return which of some frames have a range, no standard deviation and no reason, shape (k,)."""
    bare = (result.status[part] == Status.UNIQUE) & (result.reason[part] == 0)
    return np.flatnonzero(bare & np.isnan(result.roots_sd_m[part, 0]))
