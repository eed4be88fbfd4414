"""Making a `ReadingsTable`: mean readings of a scene over all ranges that its prior allows."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import (
    Background,
    FrameScene,
    RangePrior,
    Shape,
    instrument_of,
    prior_of,
)
from inference.frame.mean_readings import readings_along, with_surroundings
from inference.frame.range_prior import integration_bounds, log_range_density
from inference.frame.table import KNOT_SPACING, TURN
from inference.tracking.observed import Observed
from inference.tracking.places import Places, Scan, boxes_of
from inference.tracking.readings_table import ReadingsTable
from simulator.compiled import compiled
from simulator.errors import RefusedError
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor

__all__ = [
    "MEAN",
    "OBJECT",
    "OBJECT_SLOPE",
    "SLOPE",
    "Knots",
    "empty_readings",
    "knots_of",
    "means_over",
    "places_of",
    "table_of",
]

Array = NDArray[np.float64]

# columns of `means_over`: mean readings, their slopes, the object's part of both
MEAN, SLOPE, OBJECT, OBJECT_SLOPE = (slice(k, k + 2) for k in range(0, 8, 2))
_VALUES, _SLOPES = [0, 1, 4, 5], [2, 3, 6, 7]
_FEWEST = 256
_MOST = 1 << 16
_ERROR = 0.01  # standard deviations of a reading by which the table may be wrong
_RELATIVE_ERROR = 1e-11  # or this share of the reading, which no range feels
_VISIBLE = 0.1  # standard deviations of a reading below which a turn is not seen
_DIFFERENCE = 3e-5  # of u, for second derivatives


@compiled
def _fill(out: Array, positions: Array, scene: FrameScene) -> None:
    """Fill out (n, 8): mean readings, their derivatives along u, the object's part of both."""
    for k in range(positions.size):
        here = readings_along(positions[k], math.exp(positions[k]), 1.0, scene)
        parts = (here.mean, here.slope, here.signal, here.signal_slope)
        for j, (first, second) in enumerate(parts):
            out[k, 2 * j], out[k, 2 * j + 1] = first, second


@compiled
def _fill_prior(out: Array, positions: Array, law: RangePrior) -> None:
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
    scene, out = _scene(sensor, terms), np.empty((positions.size, 8))
    _fill(out, positions, scene)
    if not by_rate:
        return out
    low = np.maximum(positions - _DIFFERENCE, positions[0])
    high = np.minimum(positions + _DIFFERENCE, positions[-1])
    before, after = np.empty_like(out), np.empty_like(out)
    _fill(before, low, scene)
    _fill(after, high, scene)
    second = (after[:, SLOPE] - before[:, SLOPE]) / (high - low)[:, None]
    return np.column_stack([out[:, SLOPE], second, np.zeros((positions.size, 4))])


def _scene(sensor: Sensor, terms: Terms) -> FrameScene:
    """Return the first parameter vector without crosstalk, before a sensor without its noise."""
    c0, c1, c2 = terms.object[0].tolist()
    background = None if terms.background is None else Background(*terms.background[0].tolist())
    shape, prior = Shape(sensor.gain * c0 * c2, c0, c1), prior_of(terms.ranges[0])
    instrument = instrument_of(sensor)._replace(shot=None, relative=None)
    return FrameScene(shape, None, background, prior, instrument, None)


def empty_readings(sensor: Sensor, terms: Terms, by_rate: bool) -> Array:
    """Return the readings of an empty scene without crosstalk, shape (2,)."""
    if terms.background is None or by_rate:
        return np.zeros(2)
    scene = _scene(sensor, terms)
    return np.asarray(with_surroundings((0.0, 0.0), math.inf, 1.0, scene))


def _bounds(sensor: Sensor, law: RangePrior) -> tuple[float, float]:
    low, high = integration_bounds(law)
    if isinstance(sensor, PulsedSensor):
        # the late window's kink at r0 belongs to neither side
        high = min(high, math.log(sensor.r0) - 1e-12)
    return low, high


@dataclasses.dataclass(frozen=True, eq=False)
class Knots:
    """Evenly spaced knots of u, dense enough for a table of mean readings."""

    positions: Array  # (n,): u = log r, ascending
    means: Array  # (n, 8): as `means_over`, in units of the noise
    log_prior: Array  # (n,): log prior density of u

    @property
    def step(self) -> float:
        """Spacing."""
        return float((self.positions[-1] - self.positions[0]) / (self.positions.size - 1))


def knots_of(
    sensor: Sensor, terms: Terms, law: RangePrior, observed: Observed, rate_sd: float
) -> Knots:
    """Choose as many knots as the noise asks for.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    terms : Terms
        The first parameter vector is tabulated.
    law : tuple
        Prior of the range (`simulator.parameters.Terms.ranges`).
    observed : Observed
        What is read.
    rate_sd : float
        Standard deviation of the rate that derivatives are multiplied by [1/s].

    Returns
    -------
    Knots

    Raises
    ------
    RefusedError
        Where the curve turns so quickly, or the noise is so small, that no table can hold it.
    """
    factors = np.tile(observed.scale, 4)
    error = _ERROR / (5.0 * rate_sd) if observed.by_rate else _ERROR
    low, high = _bounds(sensor, law)
    if not high > low:
        raise RefusedError(
            "no range is possible: the prior of the range and the shadow exclude one another; "
            "widen range_m"
        )
    count = _FEWEST
    while count <= _MOST:
        fine = np.linspace(low, high, 2 * count + 1)
        values = means_over(fine, sensor, terms, observed.by_rate) * factors
        step = fine[2] - fine[0]
        left, right = values[:-2:2], values[2::2]
        middle = 0.5 * (left + right)[:, _VALUES]
        middle += 0.125 * step * (left - right)[:, _SLOPES]
        exact = values[1::2, _VALUES]
        allowed = np.maximum(error, _RELATIVE_ERROR * np.abs(exact))
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


def _scan_of(knots: Knots, by_rate: bool, rate_sd: float) -> NDArray[np.int64]:
    """Choose knots between which a frame's density has at most one maximum.

    They are at most `KNOT_SPACING` apart, and closer where the curve turns visibly; by rate a turn
    back of its direction counts. Returns their indices, ascending, both ends among them.
    """
    last = knots.positions.size - 1
    stride = max(1, int(KNOT_SPACING / knots.step))
    chosen = np.unique(np.append(np.arange(0, last, stride), last))
    while True:
        values = knots.means[chosen, MEAN]
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
        turns = along < TURN * length[1:] * length[:-1]
        turns &= np.maximum(length[1:], length[:-1]) > _VISIBLE
        split = np.zeros(length.size, dtype=bool)
        split[:-1] |= turns & (length[:-1] > _VISIBLE)
        split[1:] |= turns & (length[1:] > _VISIBLE)
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen.astype(np.int64)
        middle = (chosen[:-1] + chosen[1:])[split] // 2
        chosen = np.unique(np.concatenate([chosen, middle]))


def table_of(knots: Knots, nuisance: Array, crosstalk: Array, observed: Observed) -> ReadingsTable:
    """Return the kernels' table.

    Parameters
    ----------
    knots : Knots
        With means in units of the noise.
    nuisance : ndarray, shape (knots, 2 p)
        Nuisance Jacobian.
    crosstalk : ndarray, shape (2,)
        What is known of the crosstalk, in units of the noise.
    observed : Observed
        What is read.
    """
    along = knots.means * np.repeat([1.0, knots.step, 1.0, knots.step], 2)
    crosstalk1, crosstalk2 = crosstalk.tolist()
    return ReadingsTable(
        knots=np.ascontiguousarray(
            np.column_stack([along, knots.log_prior, _spread_roots(nuisance), nuisance])
        ),
        start=float(knots.positions[0]),
        step=knots.step,
        end=float(knots.positions[-1]),
        crosstalk1=crosstalk1,
        crosstalk2=crosstalk2,
        by_rate=observed.by_rate,
        noise=observed.noise,
        channels=observed.channels,
    )


def _spread_roots(nuisance: Array) -> Array:
    """Return r11, r21, r22 of the root of the nuisance parameters' covariance at every knot."""
    count, columns = nuisance.shape
    if columns == 0:
        return np.zeros((count, 3))
    # two rows of nothing, so that there are never fewer directions than readings
    changes = np.zeros((count, columns // 2 + 2, 2))
    changes[:, :-2] = nuisance.reshape(count, -1, 2)
    upper = np.asarray(np.linalg.qr(changes, mode="r"))
    first = np.where(upper[:, 0, 0] < 0, -1.0, 1.0)
    return np.column_stack([np.abs(upper[:, 0, 0]), first * upper[:, 0, 1], np.abs(upper[:, 1, 1])])


def places_of(knots: Knots, empty: Array, observed: Observed, rate_sd: float) -> Places:
    """Return where the kernels look for an object.

    Parameters
    ----------
    knots : Knots
        With means in units of the noise.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene, and their change with the nuisance parameters.
    observed, rate_sd
        As for `knots_of`.
    """
    scan = _scan_of(knots, observed.by_rate, rate_sd)
    next_one = np.searchsorted(scan, np.arange(knots.positions.size)).astype(np.int64)
    boxes, groups = boxes_of(knots.positions, knots.means, knots.log_prior, scan)
    return Places(Scan(knots.positions[scan], next_one), empty, boxes, groups)
