"""Readings that differ from frame to frame by less than their noise: a driver has smoothed them."""

import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.stuck_readings import coarsest_step
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["smoothed_readings"]

Array = NDArray[np.float64]

# how often readings with the stated noise are doubted; of either column, and of both together
_FALSE_ALARM = 1e-6 / 3
_WORTH = 0.25  # of the stated variance: noise that is stated twice too large is only cautious
_ORDER = 4  # of differences: motion that is smooth is hardly any part of them
_FARTHEST = 8.0  # steps by which rounding to steps moves such a difference at most: 2^4 / 2
_SAME = 1e-6  # of read noise, by which readings of one step differ where they were computed
_FEWEST = 12  # frames, of which fewer do not tell how smooth their noise is
_BLOCK = 64  # frames of which differences are taken
_TILTS = np.geomspace(1e-2, 1e3, 101)  # over the mean eigenvalue: of the exponential bound


def smoothed_readings(sensor: Sensor, frames: Frames) -> str | None:
    """Return how readings differ from frame to frame by less than read noise lets them.

    A column's fourth differences are those of its light and those of independent noise. Light,
    photons and drift, whatever they do, only make the sum of their squares larger (Anderson 1955),
    and that of read noise alone is seldom as small (docs/model.md, smoothed-readings).

    Parameters
    ----------
    sensor, frames : Sensor, Frames
        Frames in the order in which they were read. Those at full scale do not count.

    Returns
    -------
    str or None
        For a person. None where they differ as the stated noise lets them (false alarm at most
        1e-6), or where rounding or motion hides it.
    """
    if len(frames) < _FEWEST:
        return None
    readings, read = frames.readings, np.asarray(sensor.noise.read)
    if sensor.full_scale is not None:
        readings = readings[~frames.saturated(sensor)]
    blocks = [readings[at : at + _BLOCK] for at in range(0, len(readings), _BLOCK)]
    blocks = [block for block in blocks if len(block) > _ORDER]
    if not blocks:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        parts = [np.square(np.diff(block, _ORDER, axis=0) / read).sum(axis=0) for block in blocks]
        squares = np.sum(parts, axis=0)
    of_noise = np.concatenate([_eigenvalues(len(block)) for block in blocks])
    still = np.flatnonzero(squares < _WORTH * of_noise.sum())
    if not still.size:
        return None
    steps = [_rounding(column, sd) for column, sd in zip(readings.T, read.tolist(), strict=True)]
    rounded = math.sqrt(of_noise.size) * _FARTHEST * np.array(steps) / read
    most = float(np.square(np.sqrt(squares) + rounded)[still].sum())
    if not _log_often(most, np.tile(of_noise, still.size)) < math.log(_FALSE_ALARM):
        return None
    return _said(sensor, still, np.sqrt(squares / of_noise.sum()))


def _rounding(values: Array, read: float) -> float:
    """Return the coarsest step that readings may have been rounded to; inf: any.

    All that differ do so by a step at least. Of readings far apart in noises that tells little, and
    of which numbers they are multiples tells more.
    """
    gaps = np.diff(np.sort(values))
    gaps = gaps[gaps > _SAME * read]
    if not gaps.size:
        return math.inf
    return min(float(gaps.min()), coarsest_step(values, float(np.median(np.abs(values))), read))


@functools.lru_cache(maxsize=_BLOCK)
def _eigenvalues(count: int) -> Array:
    """Return the variances of independent sums that differences of unit noise are made of."""
    differences = np.diff(np.eye(count), _ORDER, axis=0)
    return np.asarray(np.square(np.linalg.svd(differences, compute_uv=False)))


def _log_often(square: float, of_noise: Array) -> float:
    """Return the log of how often a weighted sum of squares is as small, at most (Chernoff 1952).

    Parameters
    ----------
    square : float
        The sum.
    of_noise : ndarray, shape (m,)
        Its weights, of squares of standard normal numbers.
    """
    tilts = _TILTS / of_noise.mean()
    weights, times = np.unique(of_noise, return_counts=True)  # blocks of frames have the same
    logs = np.log1p(2.0 * tilts[:, None] * weights) @ times
    return float(np.min(tilts * square - 0.5 * logs))


def _said(sensor: Sensor, still: NDArray[np.intp], share: Array) -> str:
    names = " and ".join(sensor.columns[k] for k in still)
    how_far = " and ".join(f"{share[k]:.2g}" for k in still)
    verb = "differ" if still.size > 1 else "differs"
    return (
        f"{names} {verb} from frame to frame by less than read noise alone: {how_far} times as "
        "far as stated. If a sensor or its driver smooths readings over frames (a low-pass, a "
        "running mean), ranges are late by as much as the object moves meanwhile, and sure and "
        "wrong: send readings that are not smoothed, with their own noise. Else that noise is "
        "stated too large, or was left out in a simulation"
    )
