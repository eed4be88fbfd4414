"""From candidate roots to a result: filter, sort, status, reason, standard deviation."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult, status_of_counts
from inference.realtime.net import COMMON_REASONS, SATURATED

__all__ = [
    "DROWNED",
    "END_BAND",
    "NEGATIVE",
    "NOISE_BAND",
    "OUTSIDE",
    "Candidates",
    "Outcome",
    "assemble",
    "reasons_of",
    "up_to_wall",
    "with_place",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# standard deviations within which noise explains a reading on the wrong side of a limit
NOISE_BAND = 3.0
# the same where a frame taken for one on the right side has a range at the other end of all ranges:
# one frame in 300,000
END_BAND = 4.5
_WALL = 1.0 - 1e-9  # of a wall's distance: what reaches so far reaches it, but for rounding

NEGATIVE = (
    "the light is below zero by far more than noise: the crosstalk or the noise is not as stated"
)
"""Reason of light that is no weak light: nothing is known of what is before the sensor."""

AMBIGUOUS = len(COMMON_REASONS)
FOLD = AMBIGUOUS + 1
FILTERED = AMBIGUOUS + 2
OUTSIDE = AMBIGUOUS + 3
DROWNED = AMBIGUOUS + 4
FAINT = AMBIGUOUS + 5
_SHARED_REASONS = (
    *COMMON_REASONS,
    "more than one range explains the readings",
    "noise has merged a pair of roots into none: the range is near a fold",
    "every solution needs a negative object, or a background below zero or above its strength",
    "every solution lies outside the ranges of the scene",
    "the noise is so many times the signal that its standard deviation is no number",
    "the light is none within its errors: any farther range explains the readings too",
)


def reasons_of(*own: str) -> tuple[str, ...]:
    """Return the reasons of a technique: the shared ones, then its own."""
    return (*_SHARED_REASONS, *own)


@dataclasses.dataclass(frozen=True, eq=False)
class Candidates:
    """Solutions of a technique's equation, before any filter.

    Attributes
    ----------
    roots : ndarray, shape (n, m)
        Ranges [m], nan-padded, in any order.
    noise : ndarray, shape (n, m)
        Standard deviations by noise [m]; infinite where any farther range explains a frame too.
    near : ndarray of bool, shape (n, m)
        Whether noise reaches the fold beside the root, so that ``noise`` does not hold.
    near_frame : ndarray of bool, shape (n,)
        Whether noise reaches any fold, with or without a root.
    model : ndarray, shape (n, m), optional
        First-order standard deviations by errors of the model [m]; None where it is exact.
    merged : ndarray of bool, shape (n, m), optional
        Which are places of folds, a pair of whose roots errors may have merged into none, or ends
        beyond which errors may have moved a root.
    """

    roots: Array
    noise: Array
    near: Flags
    near_frame: Flags
    model: Array | None = None
    merged: Flags | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Outcome:
    """What is decided about candidates.

    Attributes
    ----------
    physical : ndarray of bool, shape (n, m)
        Whether a solution passes the technique's physical filter.
    support : (float, float)
        Ranges that the scene allows [m], ends included.
    reason : ndarray of uint8, shape (n,)
        Why a frame has no root, as far as the technique can tell from its readings; else 0.
    reasons : tuple of str
        The texts.
    """

    physical: Flags | None
    support: tuple[float, float]
    reason: NDArray[np.uint8]
    reasons: tuple[str, ...]


def up_to_wall(candidates: Candidates, wall_m: float, bare: Flags) -> Candidates:
    """Mark frames of which noise moves a root up to the wall, where the curve ends.

    Its standard deviation is a third of how far noise reaches there, not that of a normal law.

    Parameters
    ----------
    candidates : Candidates
        Solutions before a wall.
    wall_m : float
        Its distance [m].
    bare : ndarray of bool, shape (n,)
        Frames that the bare wall may have given, see `free_light.may_be_none`.
    """
    with np.errstate(invalid="ignore"):
        ends = candidates.roots + NOISE_BAND * candidates.noise >= wall_m * _WALL
        alone = np.isfinite(candidates.roots) & (candidates.roots < wall_m * _WALL)
    frames = candidates.near_frame | ((ends | bare[:, None]) & alone).any(axis=1)
    return dataclasses.replace(candidates, near_frame=frames)


def with_place(candidates: Candidates, frames: Flags, place_m: float) -> Candidates:
    """Add a place at which an object may be whose root noise has moved away, as a fold's is.

    Parameters
    ----------
    candidates : Candidates
        The other solutions: alone such a place is no answer.
    frames : ndarray of bool, shape (n,)
        In which of them.
    place_m : float
        The place [m].
    """
    if not frames.any():
        return candidates
    n = frames.size

    def beside(columns: NDArray[Any] | None, column: NDArray[Any]) -> NDArray[Any]:
        first = np.zeros(candidates.roots.shape, column.dtype) if columns is None else columns
        return np.column_stack([np.broadcast_to(first, candidates.roots.shape), column])

    model = candidates.model
    return Candidates(
        roots=beside(candidates.roots, np.where(frames, place_m, np.nan)),
        noise=beside(candidates.noise, np.full(n, np.nan)),
        near=beside(candidates.near, frames),
        near_frame=candidates.near_frame,
        model=None if model is None else beside(model, np.zeros(n)),
        merged=beside(candidates.merged, frames),
    )


def _moved_back(
    candidates: Candidates, outside: Flags, support: tuple[float, float]
) -> tuple[Array, Flags]:
    """Return roots, and which of those ``outside`` errors may have moved out of the scene's ranges.

    Without them another root would be the only one. They are put at the end that they left by, one
    at each.
    """
    ends = np.clip(candidates.roots, *support)
    sd = candidates.noise
    if candidates.model is not None:
        sd = np.hypot(sd, candidates.model)
    moved = outside & (np.abs(candidates.roots - ends) < END_BAND * sd)
    for end in support:
        here = moved & (ends == end)
        moved &= ~here | (np.cumsum(here, axis=1) == 1)
    return np.where(moved, ends, candidates.roots), moved


def assemble(
    name: str, state: NDArray[np.uint8], candidates: Candidates, outcome: Outcome
) -> TechniqueResult:
    """Build the result of a technique.

    Parameters
    ----------
    name : str
        The technique.
    state : ndarray of uint8, shape (n,)
        What rules frames out, see `net.rule_out`.
    candidates : Candidates
        All solutions.
    outcome : Outcome
        Filters and reasons.

    Returns
    -------
    TechniqueResult
        Without run time.
    """
    with np.errstate(all="ignore"):
        found = np.isfinite(candidates.roots) & (candidates.roots > 0) & (state == 0)[:, None]
        slack = 8 * np.finfo(float).eps
        low, high = outcome.support
        inside = (candidates.roots >= low * (1 - slack)) & (candidates.roots <= high * (1 + slack))
        physical = found if outcome.physical is None else found & outcome.physical
        keep = physical & inside
        if candidates.merged is not None:
            # alone, a fold is a reason; beside a root it is what else may explain the frame
            single = ~candidates.merged
            found, physical = found & single, physical & single
            keep &= (keep & single).any(axis=1)[:, None] | single
        places, beside = candidates.roots, candidates.near
        moved_out = physical & ~inside & keep.any(axis=1)[:, None]
        if moved_out.any():
            places, moved_out = _moved_back(candidates, moved_out, outcome.support)
            keep, beside = keep | moved_out, beside | moved_out
        count = np.count_nonzero(keep, axis=1)
        width = max(int(count.max(initial=0)), 1)
        roots = np.where(keep, places, np.nan)
        linear = keep & ~beside
        noise = np.where(linear & np.isfinite(candidates.noise), candidates.noise, np.nan)
        # readings are rounded, however little noise they have
        noise = np.maximum(noise, np.finfo(float).eps * candidates.roots)
        model = np.zeros((1, 1)) if candidates.model is None else candidates.model
        sd = noise if candidates.model is None else np.hypot(noise, model)
        sd = np.where(np.isfinite(sd), sd, np.nan)
        drowned = (linear & np.isnan(sd)).any(axis=1)
        faint = (linear & np.isposinf(candidates.noise)).any(axis=1)
        model = np.broadcast_to(model, sd.shape)
        if roots.shape[1] > 1:
            order = np.argsort(roots, axis=1, kind="stable")[:, :width]
            roots, sd, noise, model = (
                np.take_along_axis(columns, order, axis=1) for columns in (roots, sd, noise, model)
            )
    status = status_of_counts(count)
    near = (candidates.near_frame | (keep & beside).any(axis=1)) & (state == 0)
    # the most specific reason that holds: the technique's own, then what removed its solutions
    reason = np.zeros(state.size, dtype=np.uint8)
    none = count == 0
    reason[none & ~found.any(axis=1) & near] = FOLD
    reason[none & found.any(axis=1)] = FILTERED
    reason[none & physical.any(axis=1)] = OUTSIDE
    own = none & (outcome.reason > 0) & ~found.any(axis=1) & (reason != FOLD)
    reason[own] = outcome.reason[own]
    reason[(count == 1) & drowned] = DROWNED
    reason[(count == 1) & faint] = FAINT
    reason[count > 1] = AMBIGUOUS
    ruled_out = state > 0
    reason[ruled_out] = state[ruled_out]
    status[state == SATURATED] = Status.SATURATED
    return TechniqueResult(
        technique=name,
        status=status,
        roots_m=roots,
        roots_sd_m=sd,
        sd_parts_m=SdParts(noise, np.broadcast_to(0.0, sd.shape), model),
        root_count=count.astype(np.intp),
        near_fold=near,
        reason=reason,
        reasons=outcome.reasons,
    )
