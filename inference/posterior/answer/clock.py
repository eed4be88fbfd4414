"""Ranges that a ruler tells, and the effective distance that the readings tell of them.

They differ by the clock's error (docs/model.md, clock-beside-rulers). Draws of a posterior have the
effective distance, which the ruler knows as well as both together; answers have the ruler's range.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames

__all__ = ["as_ruled", "with_clock_error"]

Array = NDArray[np.float64]


def with_clock_error(frames: Frames, size: float) -> Frames:
    """Return frames whose known ranges are those of the effective distance.

    Parameters
    ----------
    frames : Frames
        As given.
    size : float
        Standard deviation of the clock's error [m].
    """
    sd = frames.known_range_sd_m
    if sd is None or not size > 0.0:
        return frames
    return dataclasses.replace(frames, known_range_sd_m=np.hypot(sd, size))


def as_ruled(frames: Frames, range_m: Array, size: float, rng: np.random.Generator) -> Array:
    """Return draws of the effective distance as draws of the range that a ruler tells.

    With w the share of the ruler's variance in both, the range is normal about
    known + w (effective - known) with variance w size^2. Moves by a smooth error of the clock,
    which draws have already, are w^2 size^2 of that.

    Parameters
    ----------
    frames : Frames
        As given.
    range_m : ndarray, shape (..., n)
        Draws [m].
    size : float
        Standard deviation of the clock's error [m].

    Returns
    -------
    ndarray, shape (..., n)
    """
    known, sd = frames.known_range_m, frames.known_range_sd_m
    if known is None or sd is None or not size > 0.0:
        return range_m
    told = np.flatnonzero(np.isfinite(known) & frames.present)
    share = 1.0 / (1.0 + np.square(size / sd[told]))
    own = size * np.sqrt(share * (1.0 - share))
    found = range_m.copy()
    off = found[..., told] - known[told]
    drawn = known[told] + share * off + own * rng.standard_normal(off.shape)
    # of a ruler that reaches to nothing, what was drawn
    found[..., told] = np.where(drawn > 0.0, drawn, found[..., told])
    return found
