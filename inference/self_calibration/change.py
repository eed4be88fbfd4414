"""Has the curve of the readings moved? The trace of a change that the law of the scene would hide.

The readings of all ranges lie on one curve in their plane. What is unknown of a scene bends and
shifts it, by the same in every frame; noise of single frames moves no curve. So frames before and
after a change lie on two curves, to within the noise, though either may lie well within what the
law of the scene allows: a wall that nobody stated is a shift of five read noises in each frame and
of one standard deviation of the crosstalk. Each frame gives one residual, across the curve, after
its range has been fitted; what is unknown is fitted to all of them within its law, and to those
after a split a shift of the crosstalk besides, linear in all of it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import instrument_of
from inference.frame.noise import covariances
from inference.self_calibration.withholding import surprise_of_empty
from inference.tracking.readings_table import MEAN, NUISANCE, SIGNAL, SPREAD
from inference.tracking.tracker import Tracker
from simulator.frames import Frames

__all__ = ["FEWEST", "Residuals", "has_changed", "surprises_of", "without_unknowns"]

Array = NDArray[np.float64]

FEWEST = 8
"""Usable frames on either side of a split."""

_SPLITS = (15, 30, 60, 120)  # frames after the change
_FALSE_ALARM = 1e-6  # of a look, over all splits
_STARTS = 128  # places along the curve from which ranges are fitted
_TURNS = 3
_FARTHEST = 0.3  # of log r, in one turn
_SURELY_THERE = 50.0  # chi-square of readings without the object
_BRIGHT = 5.0  # read noises by which the readings change with log r: darker frames tell no range


class Residuals(NamedTuple):
    """Of n frames across the curve, in units of their noise.

    Attributes
    ----------
    values : ndarray, shape (n,)
        Where all that is unknown is at its centre.
    changes : ndarray, shape (n, p)
        Change with each unknown by a standard deviation.
    across : ndarray, shape (n, 2)
        Change with the crosstalk by a read noise.
    """

    values: Array
    changes: Array
    across: Array


def has_changed(
    model: Tracker, frames: Frames, usable: NDArray[np.bool_], walk: Array, widest: Array
) -> bool:
    """Tell whether the last frames lie on another curve than those before.

    Parameters
    ----------
    model : Tracker
        Of the scene in force.
    frames : Frames
        The last ones.
    usable : ndarray of bool, shape (n,)
        Which may hold the object.
    walk, widest : ndarray, shape (2,)
        Standard deviation of what the crosstalk does anyway meanwhile, and of a change [reading
        units].

    Returns
    -------
    bool
        Of a scene and a walk as stated at most once in a million looks, to first order in what is
        unknown: what a free shift gains is a chi-square of two degrees of freedom, and a shift
        that is held gains less. False where nothing would show it.
    """
    if not all(model.observed.used) or model.observed.by_rate:
        return False  # one number a frame lies on any curve
    found = _residuals(model, frames, usable & ~_maybe_empty(model, frames))
    if found is None:
        return False
    bright, at = found
    walk, widest = walk * model.observed.scale, widest * model.observed.scale
    place = np.arange(len(frames))[bright]
    behind = [place >= len(frames) - count for count in _SPLITS]
    told = [k for k in behind if min(np.count_nonzero(k), np.count_nonzero(~k)) >= FEWEST]
    left = without_unknowns(at, told)
    gained = surprises_of(left, walk) - surprises_of(left, widest)
    # a chi-square of two degrees of freedom is beyond -2 log p with probability p
    return bool((gained > -2.0 * math.log(_FALSE_ALARM / len(_SPLITS))).any())


def without_unknowns(at: Residuals, behind: Sequence[NDArray[np.bool_]]) -> Array:
    """Return what residuals tell of shifts, whatever the unknowns are within their law.

    Parameters
    ----------
    at : Residuals
        Of n frames.
    behind : sequence of ndarray of bool, each of shape (n,)
        Of k splits, which frames are shifted.

    Returns
    -------
    ndarray, shape (2 k + 1, 2 k + 1)
        A triangle: to its columns, two a split and the residuals' own, the surprise is least
        squares as it is to all frames.
    """
    n, p = at.changes.shape
    shifted = [k[:, None] * at.across for k in behind]
    table = np.zeros((n + p, p + 2 * len(behind) + 1))
    table[:n] = np.column_stack([at.changes, *shifted, at.values])
    table[n:, :p] = np.eye(p)
    return np.asarray(np.linalg.qr(table, mode="r"))[p:, p:]


def surprises_of(left: Array, sd: Array) -> Array:
    """Return the chi-square of residuals that may be shifted behind one of k splits, shape (k,).

    Parameters
    ----------
    left : ndarray, shape (2 k + 1, 2 k + 1)
        From `without_unknowns`.
    sd : ndarray, shape (2,)
        Standard deviations of the shift's components [read noises].
    """
    rows = len(left)
    table = np.zeros((rows // 2, rows + 2, 3))
    table[:, :-2, :2] = left[:, :-1].reshape(rows, -1, 2).transpose(1, 0, 2) * sd
    table[:, :-2, 2] = left[:, -1]
    table[:, -2:, :2] = np.eye(2)
    upper = np.asarray(np.linalg.qr(table, mode="r"))
    return np.asarray(np.square(upper[:, -1, -1]))


def _residuals(
    model: Tracker, frames: Frames, usable: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], Residuals] | None:
    """Fit all ranges, and what is unknown; return which frames tell theirs, and what is left."""
    table = model.model.table
    knots, count = table.knots, (table.knots.shape[1] - NUISANCE) // 2
    readings = frames.readings * model.observed.scale
    readings = readings - np.array([table.crosstalk1, table.crosstalk2])
    if frames.gain is not None:
        readings = readings / frames.gain[:, None]
    u = _nearest(knots, readings) * table.step
    unknown = np.zeros(count)
    bright = usable
    for _ in range(_TURNS):
        mean, slope, jacobian = _curve(knots, u / table.step, count)
        slope = slope / table.step
        speed = np.hypot(slope[:, 0], slope[:, 1])
        bright = usable & (speed > _BRIGHT) & np.isfinite(readings).all(axis=1)
        if bright.sum() < 2 * FEWEST:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            normal = np.column_stack([-slope[:, 1], slope[:, 0]]) / speed[:, None]
        off = readings - mean
        noise = _noise(model, frames, knots, u / table.step, normal)
        values = np.einsum("ni,ni->n", normal, off) / noise
        changes = np.einsum("npi,ni->np", jacobian, normal) / noise[:, None]
        system = np.vstack([changes[bright], np.eye(count)])
        right = np.concatenate([values[bright], np.zeros(count)])
        unknown = np.linalg.lstsq(system, right)[0]
        left = off - np.einsum("npi,p->ni", jacobian, unknown)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = np.einsum("ni,ni->n", slope, left) / np.square(speed)
        along = np.where(speed > 0, along, 0.0)
        u = np.clip(u + np.clip(along, -_FARTHEST, _FARTHEST), 0.0, (len(knots) - 1) * table.step)
    gain = frames.gains
    across = normal / (noise * gain)[:, None]
    return bright, Residuals(values[bright], changes[bright], across[bright])


def _maybe_empty(model: Tracker, frames: Frames) -> NDArray[np.bool_]:
    """Tell which frames an empty scene explains, or nearly: they have no range to be fitted."""
    return np.asarray(surprise_of_empty(model, frames) < _SURELY_THERE)


def _nearest(knots: Array, readings: Array) -> Array:
    """Return the knots that are most probable, given what unknowns and half a step allow.

    A knot where unknowns allow anything, beside a wave as near as no object comes, would always
    explain readings better than one half a step off: the log of what is allowed counts as well.
    """
    every = -(-len(knots) // _STARTS)
    some = knots[::every]
    r11, r21, r22 = some[:, SPREAD : SPREAD + 3].T
    away1, away2 = 0.5 * every * some[:, MEAN + 2 : MEAN + 4].T
    # of I + R R^T and half a step, whose root whitens
    a, b = 1.0 + r11**2 + away1**2, r11 * r21 + away1 * away2
    first = np.sqrt(a)
    # c - b^2/a, of which nothing is subtracted that is large beside it
    rest = 1.0 + r22**2 + (r21**2 + away2**2 + (r11 * away2 - r21 * away1) ** 2) / a
    second = np.sqrt(rest)
    off1 = (readings[:, None, 0] - some[:, MEAN]) / first
    off2 = (readings[:, None, 1] - some[:, MEAN + 1] - (b / first) * off1) / second
    return np.asarray(
        every * np.argmin(off1**2 + off2**2 + 2.0 * np.log(first * second), axis=1),
        dtype=np.float64,
    )


def _curve(knots: Array, at: Array, count: int) -> tuple[Array, Array, Array]:
    """Return means, their slopes by knots, and what p unknowns do to them, shape (n, p, 2)."""
    i = np.minimum(at.astype(np.int64), len(knots) - 2)
    t = (at - i)[:, None]
    a, left = knots[i, MEAN : MEAN + 2], knots[i, MEAN + 2 : MEAN + 4]
    b, right = knots[i + 1, MEAN : MEAN + 2], knots[i + 1, MEAN + 2 : MEAN + 4]
    bend, twist = 3.0 * (b - a) - 2.0 * left - right, left + right - 2.0 * (b - a)
    mean = a + t * (left + t * (bend + t * twist))
    slope = left + t * (2.0 * bend + 3.0 * t * twist)
    jacobian = knots[i, NUISANCE:] + t * (knots[i + 1, NUISANCE:] - knots[i, NUISANCE:])
    return mean, slope, jacobian.reshape(len(at), count, 2)


def _noise(model: Tracker, frames: Frames, knots: Array, at: Array, normal: Array) -> Array:
    """Return the standard deviation of the noise across the curve, in units of the read noise."""
    gain = frames.gains
    if model.model.table.noise.plain:
        return 1.0 / gain
    i = np.rint(at).astype(np.int64)
    units = np.asarray(model.observed.units)
    table = model.model.table
    still = np.array([table.crosstalk1, table.crosstalk2])
    means = (gain[:, None] * knots[i, MEAN : MEAN + 2] + still) * units
    signals = gain[:, None] * knots[i, SIGNAL : SIGNAL + 2] * units
    found = covariances(instrument_of(model.sensor), means, signals) / np.outer(units, units)
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", normal, found, normal)) / gain)
