"""Making a `Curve`: the mean readings of a scene over all ranges that its prior allows."""

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.density.curve_table import integration_bounds
from inference.density.integrand import Law, Quad, Triple, log_range_density
from inference.tracking.curve import GROUP
from simulator.compiled import compiled
from simulator.errors import RefusedError
from simulator.parameters import Terms
from simulator.readings import (
    background_readings,
    background_slopes,
    object_readings,
    object_slopes,
)
from simulator.sensor import PulsedSensor, Sensor, instrument

__all__ = ["Knots", "boxes_of", "empty_readings", "knots_of", "means_over", "scan_of"]

Array = NDArray[np.float64]
Pair = tuple[float, float]

_VALUES, _SLOPES = [0, 1, 4, 5], [2, 3, 6, 7]  # columns of `means_over`
_FEWEST = 256
_MOST = 1 << 16
_ERROR = 0.01  # standard deviations of a reading by which the table may be wrong
_RELATIVE_ERROR = 1e-11  # or this share of the reading, which no range feels
_SCAN_SPACING = 0.0365
_TURN = 0.7  # cosine of the largest turn of the curve at a scanned knot
_VISIBLE = 0.1  # standard deviations of a reading below which a turn is not seen
_LEAST_SPEED = 0.7  # of the least speed at knots: between them it may be less
_DIFFERENCE = 3e-5  # of u, for second derivatives


@compiled
def _fill(
    out: Array,
    positions: Array,
    r0: float,
    wave: Pair | None,
    shape: Triple,
    background: Quad | None,
) -> None:
    """Fill out (n, 8): mean readings, their derivatives along u, the object's part of both."""
    for k in range(positions.size):
        r = math.exp(positions[k])
        o1, o2 = object_readings(r, r0, wave, shape[0], shape[1], shape[2])
        d1, d2 = object_slopes(r, r0, wave, shape[0], shape[1], shape[2])
        out[k, 4], out[k, 5], out[k, 6], out[k, 7] = o1, o2, d1, d2
        if background is not None:
            b1, b2 = background_readings(r, r0, wave, background)
            a1, a2 = background_slopes(r, r0, wave, background)
            o1, o2, d1, d2 = o1 + b1, o2 + b2, d1 + a1, d2 + a2
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = o1, o2, d1, d2


@compiled
def _fill_prior(out: Array, positions: Array, law: Law) -> None:
    for k in range(positions.size):
        out[k] = log_range_density(math.exp(positions[k]), positions[k], law)


def means_over(positions: Array, sensor: Sensor, terms: Terms, by_rate: bool) -> Array:
    """Return readings along a curve, not scaled by the noise.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        u = log r.
    sensor : Sensor
        The sensor.
    terms : Terms
        The first parameter vector is used; crosstalk plays no part.
    by_rate : bool
        Whether derivatives in time are read: the factors of du/dt.

    Returns
    -------
    ndarray, shape (n, 8)
        Means, their derivatives along u, the object's part of both.
    """
    c0, c1, c2 = terms.object[0].tolist()
    background = None if terms.background is None else tuple(terms.background[0].tolist())
    r0, wave = instrument(sensor)
    out = np.empty((positions.size, 8))
    shape = (sensor.gain * c0 * c2, c0, c1)
    _fill(out, positions, r0, wave, shape, background)
    if not by_rate:
        return out
    low = np.maximum(positions - _DIFFERENCE, positions[0])
    high = np.minimum(positions + _DIFFERENCE, positions[-1])
    before, after = np.empty_like(out), np.empty_like(out)
    _fill(before, low, r0, wave, shape, background)
    _fill(after, high, r0, wave, shape, background)
    second = (after[:, 2:4] - before[:, 2:4]) / (high - low)[:, None]
    return np.column_stack([out[:, 2:4], second, np.zeros((positions.size, 4))])


def empty_readings(sensor: Sensor, terms: Terms, by_rate: bool) -> Array:
    """Return the readings of an empty scene without crosstalk, shape (2,)."""
    if terms.background is None or by_rate:
        return np.zeros(2)
    r0, wave = instrument(sensor)
    return np.asarray(background_readings(math.inf, r0, wave, tuple(terms.background[0].tolist())))


def _bounds(sensor: Sensor, law: Law) -> tuple[float, float]:
    low, high = integration_bounds(law)
    if isinstance(sensor, PulsedSensor):
        # the late window's kink at r0 belongs to neither side
        high = min(high, math.log(sensor.r0) - 1e-12)
    return low, high


class Knots:
    """Evenly spaced knots of u, dense enough for a table of mean readings."""

    def __init__(self, positions: Array, means: Array, log_prior: Array) -> None:
        self.positions, self.means, self.log_prior = positions, means, log_prior

    @property
    def step(self) -> float:
        """Spacing."""
        return float((self.positions[-1] - self.positions[0]) / (self.positions.size - 1))


def knots_of(
    sensor: Sensor, law: Law, means: Callable[[Array], Array], largest_factor: float
) -> Knots:
    """Choose as many knots as the noise asks for.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    law : tuple
        Prior of the range (`simulator.parameters.Terms.ranges`).
    means : callable
        Positions to means, slopes and the object's part in units of the noise, shape (n, 8).
    largest_factor : float
        What the means are multiplied by at most.

    Returns
    -------
    Knots

    Raises
    ------
    RefusedError
        Where the curve turns so quickly, or the noise is so small, that no table can hold it.
    """
    low, high = _bounds(sensor, law)
    if not high > low:
        raise RefusedError(
            "no range is possible: the prior of the range and the shadow exclude one another; "
            "widen range_m"
        )
    count = _FEWEST
    while count <= _MOST:
        fine = np.linspace(low, high, 2 * count + 1)
        values = means(fine)
        step = fine[2] - fine[0]
        left, right = values[:-2:2], values[2::2]
        middle = 0.5 * (left + right)[:, _VALUES]
        middle += 0.125 * step * (left - right)[:, _SLOPES]
        exact = values[1::2, _VALUES]
        allowed = np.maximum(_ERROR / largest_factor, _RELATIVE_ERROR * np.abs(exact))
        if bool((np.abs(middle - exact) <= allowed).all()):
            prior = np.empty(count + 1)
            positions = np.ascontiguousarray(fine[::2])
            _fill_prior(prior, positions, law)
            return Knots(positions, np.ascontiguousarray(values[::2]), prior)
        count *= 2
    raise RefusedError(
        f"the readings turn too quickly along the range for a table of {_MOST} knots within "
        "their noise; narrow range_m, or state the noise as it is"
    )


def scan_of(knots: Knots, by_rate: bool, rate_sd: float) -> NDArray[np.int64]:
    """Choose knots between which a frame's density has at most one maximum.

    They are at most `_SCAN_SPACING` apart, and closer where the curve turns visibly.

    Parameters
    ----------
    knots : Knots
        With means in units of the noise.
    by_rate, rate_sd
        Where means are factors of the rate, a turn back of their direction counts.

    Returns
    -------
    ndarray of int
        Indices of knots, ascending, both ends among them.
    """
    last = knots.positions.size - 1
    stride = max(1, int(_SCAN_SPACING / knots.step))
    chosen = np.unique(np.append(np.arange(0, last, stride), last))
    while True:
        values = knots.means[chosen, :2]
        if by_rate:
            size = np.linalg.norm(values, axis=1) * 3.0 * rate_sd
            angle = np.unwrap(np.arctan2(values[:, 1], values[:, 0]), period=math.pi)
            # along the direction nothing is seen, since the rate is free
            values = np.column_stack([np.zeros(size.size), angle])
            steps = np.diff(values, axis=0) * np.minimum(size[1:], size[:-1])[:, None]
        else:
            steps = np.diff(values, axis=0)
        length = np.linalg.norm(steps, axis=1)
        along = np.einsum("ij,ij->i", steps[1:], steps[:-1])
        turns = along < _TURN * length[1:] * length[:-1]
        turns &= np.maximum(length[1:], length[:-1]) > _VISIBLE
        split = np.zeros(length.size, dtype=bool)
        split[:-1] |= turns & (length[:-1] > _VISIBLE)
        split[1:] |= turns & (length[1:] > _VISIBLE)
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen.astype(np.int64)
        middle = (chosen[:-1] + chosen[1:])[split] // 2
        chosen = np.unique(np.concatenate([chosen, middle]))


def boxes_of(knots: Knots, scan: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the boxes and groups of `inference.tracking.curve.Places`.

    Parameters
    ----------
    knots : Knots
        With means in units of the noise.
    scan : ndarray of int
        From `scan_of`.
    """
    boxes = np.empty((scan.size - 1, 6))
    for j, (a, b) in enumerate(itertools.pairwise(scan)):
        part = knots.means[a : b + 1, :4]
        low, high = part[:, :2].min(axis=0), part[:, :2].max(axis=0)
        # the curve may leave the box of its knots a little
        margin = 0.05 + 0.05 * (high - low)
        boxes[j, :4] = np.column_stack([low - margin, high + margin]).ravel()
        width = knots.positions[b] - knots.positions[a]
        top = math.exp(knots.log_prior[a : b + 1].max())
        chord = part[-1, :2] - part[0, :2]
        length = float(np.linalg.norm(chord))
        slowest = float((part[:, 2:] @ chord).min()) / length if length > 0.0 else 0.0
        boxes[j, 4] = top * width
        within = math.sqrt(2.0 * math.pi) / (_LEAST_SPEED * slowest) if slowest > 0.0 else width
        boxes[j, 5] = top * min(within, width)
    firsts = np.arange(0, boxes.shape[0], GROUP)
    lows = np.minimum.reduceat(boxes[:, [0, 2]], firsts)
    highs = np.maximum.reduceat(boxes[:, [1, 3]], firsts)
    return boxes, np.column_stack([lows[:, 0], highs[:, 0], lows[:, 1], highs[:, 1]])
