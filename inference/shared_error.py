"""What single frames owe to a scene that is known by a joint law: an error that all frames share.

Techniques of single frames want numbers. They get those at the centre of the law, and what its
spread does to their roots is found by solving again with the numbers a standard deviation off, on
either side along each of its independent directions: half the difference is the root's change. It
is taken by the secant, not by a derivative, for it is as far as the uncertainty goes.
"""

import dataclasses
from collections.abc import Iterable

import numpy as np

from inference.estimates import SdParts, TechniqueResult
from inference.realtime.nearest_roots import nearest

__all__ = ["with_shared_error"]


def with_shared_error(
    result: TechniqueResult, around: Iterable[tuple[TechniqueResult, TechniqueResult]]
) -> TechniqueResult:
    """Add the scene's part to the standard deviations of roots.

    Parameters
    ----------
    result : TechniqueResult
        With the numbers at the centre of the joint law.
    around : iterable of (TechniqueResult, TechniqueResult)
        With those a standard deviation off, all roots, a pair for each direction.

    Returns
    -------
    TechniqueResult
        Where a root is lost on the way its frame is `near_fold`, and the root has no standard
        deviation.
    """
    roots = result.roots_m
    square = np.zeros_like(roots)
    for plus, minus in around:
        square += np.square(0.5 * (nearest(roots, plus.roots_m) - nearest(roots, minus.roots_m)))
    shared = np.sqrt(square)
    lost = np.isfinite(roots) & np.isnan(shared)
    parts = result.sd_parts_m
    return dataclasses.replace(
        result,
        roots_sd_m=np.hypot(result.roots_sd_m, shared),
        near_fold=result.near_fold | lost.any(axis=1),
        sd_parts_m=None if parts is None else SdParts(parts.noise, shared, parts.model),
    )
