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
from inference.tracking.observed import Observed
from inference.tracking.places import Places, Scan, boxes_of
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.scan import places_around_folds, scan_of
from simulator.compiled import compiled
from simulator.errors import RefusedError
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor
from simulator.sensor_unknowns import sensor_at

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
_NARROWEST = 1e-12  # log range that a table covers
_FEWEST = 256
_MOST = 1 << 16
_ERROR = 0.01  # standard deviations of a reading by which the table may be wrong
_SHARE = 2e-14  # or this share of the reading: a hundred roundings
_MOST_SHARE = 1e-11  # and no more than this with as many knots as there may be
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
    sensor = sensor_at(sensor, terms)
    c0, c1, c2 = terms.object[0].tolist()
    background = None if terms.background is None else Background(*terms.background[0].tolist())
    shape, prior = Shape(sensor.known_gain * c0 * c2, c0, c1), prior_of(terms.ranges[0])
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
        # the late window's kinks, at r0 and where it begins, belong to neither side
        shift = sensor.known_shift_m
        high = min(high, math.log(max(sensor.r0 - shift, 1e-300)) - 1e-12)
        if shift < 0.0:
            low = max(low, math.log(-shift) + 1e-12)
    return low, high


@dataclasses.dataclass(frozen=True, eq=False)
class Knots:
    """Evenly spaced knots of u, dense enough for a table of mean readings."""

    positions: Array  # (n,): u = log r, ascending
    means: Array  # (n, 8): as `means_over`, in units of the noise
    log_prior: Array  # (n,): log prior density of u
    # share of a reading by which a table of them is wrong where that is more than its noise hides
    error: float = 0.0

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
        Where no range is left, or no more than a point; where the curve turns so quickly, or the
        noise is so small, that no table can hold it.
    """
    factors = np.tile(observed.scale, 4)
    error = _ERROR / (5.0 * rate_sd) if observed.by_rate else _ERROR
    low, high = _bounds(sensor_at(sensor, terms), law)
    if not high > low:
        raise RefusedError(
            "no range is possible: the prior of the range and the shadow exclude one another; "
            "widen range_m"
        )
    if not high - low > _NARROWEST:
        raise RefusedError(
            "the prior of the range leaves less of it than rounding does: widen range_m"
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
        off, size = np.abs(middle - exact), np.abs(exact)
        share = _SHARE if count < _MOST else _MOST_SHARE
        if bool((off <= np.maximum(error, share * size)).all()):
            prior = np.empty(count + 1)
            positions = np.ascontiguousarray(fine[::2])
            _fill_prior(prior, positions, law)
            seen = off > error
            rest = float(np.divide(off, size, out=np.zeros_like(off), where=seen).max())
            return Knots(positions, np.ascontiguousarray(values[::2]), prior, rest)
        count *= 2
    raise RefusedError(
        f"the readings turn too quickly along the range for a table of {_MOST} knots within "
        "their noise; narrow range_m, or state the noise as it is"
    )


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


def places_of(
    knots: Knots, nuisance: Array, empty: Array, observed: Observed, rate_sd: float
) -> Places:
    """Return where the kernels look for an object.

    Parameters
    ----------
    knots : Knots
        With means in units of the noise.
    nuisance : ndarray, shape (knots, 2 p)
        Nuisance Jacobian.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene, and their change with the nuisance parameters.
    observed, rate_sd
        As for `knots_of`.
    """
    means, slopes, roots = knots.means[:, MEAN], knots.means[:, SLOPE], _spread_roots(nuisance)
    scan = scan_of(knots.positions, means, roots, observed.by_rate, rate_sd)
    boxes, groups = boxes_of(knots.positions, knots.means, knots.log_prior, roots, scan)
    positions = knots.positions[scan]
    if not observed.by_rate:
        around = places_around_folds(knots.positions, means, slopes, roots)
        positions = np.unique(np.concatenate([positions, around]))
    next_one = np.searchsorted(positions, knots.positions).astype(np.int64)
    return Places(Scan(positions, next_one), empty, boxes, groups)
