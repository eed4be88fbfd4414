"""What the kernels of a frame take: named tuples, and the one function that opens them.

A member that is None is absent from the machine code where it is handed to a kernel as an argument
of its own: numba prunes ``if background is not None`` for arguments, not for members. Kernels that
look into an optional member are therefore small and take it alone. numba types a function that
returns a tuple or None as optional even where the argument decides; `overload` chooses the body by
the argument's type instead, so that an absent term stays absent.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled, when_compiling
from simulator.sensor import Reach, Sensor, instrument

__all__ = [
    "Background",
    "FluxError",
    "FrameScene",
    "Instrument",
    "Pair",
    "RangePrior",
    "Rows",
    "Shape",
    "instrument_of",
    "prior_of",
    "row_of",
    "scene_of",
]

Array = NDArray[np.float64]
Pair = tuple[float, float]


class Instrument(NamedTuple):
    """A sensor as the kernels take it (`simulator.readings`).

    Attributes
    ----------
    r0 : float or (float, float)
        c T_p / 2 of a pulse [m], and with it the length of a timing offset where the sensor has one
        (`simulator.readings.late_share`); 0 for a sine wave, which does not read it.
    wave : (float, float) or None
        Wave number [rad/m] and phase offset [rad] of a sine wave; None for a pulse.
    read : (float, float)
        Standard deviations of the read noise [reading units].
    shot : float or None
        Variance per mean reading [reading units].
    relative : float or None
        Standard deviation of a common relative error.
    of_source : bool
        Whether all light of the source has it, not the object's alone.
    """

    r0: Reach
    wave: Pair | None
    read: Pair
    shot: float | None
    relative: float | None
    of_source: bool = False


class Shape(NamedTuple):
    """The object: gain c0 c2 [reading units m^4], c0 [m^2] and c1 [m]."""

    strength: float
    c0: float
    c1: float


class Background(NamedTuple):
    """Strength [reading units] and distance [m] of a background, c0' [m^2], c1' [m] of its shadow.

    The order is that of `simulator.readings.background_readings`.
    """

    strength: float
    distance: float
    c0: float
    c1: float


class RangePrior(NamedTuple):
    """The prior density of a range, as a row of `simulator.parameters.Terms.ranges`.

    log p(r) = constant + power log r - ((r - mean) inverse_sd)^2 / 2
    - ((log r - log_mean) log_inverse_sd)^2 / 2 on [low, high].

    Attributes
    ----------
    constant, power, log_mean, log_inverse_sd : float
        Dimensionless; log r is that of metres.
    mean, low, high : float
        [m].
    inverse_sd : float
        [1/m].
    resolves : bool
        Whether the density is to be multiplied by what a frame resolves of its range: under a
        reference prior, but for maxima over ranges, where that is flat in log r. It is a number and
        no type, so that one machine code does for all priors, integrates and maximises.
    dark : float
        Factor on that where a frame resolves nothing (`inference.frame.dark_mass`).
    """

    constant: float
    power: float
    mean: float
    inverse_sd: float
    log_mean: float
    log_inverse_sd: float
    low: float
    high: float
    resolves: bool
    dark: float = 1.0


class FluxError(NamedTuple):
    """A smooth relative error of the object's flux, a cubic in log r between knots.

    Attributes
    ----------
    knots : ndarray, shape (knots, 2)
        Logarithm of the factor on the flux, and its slope times the knots' spacing.
    first : float
        log r of the first knot.
    rate : float
        One over the spacing.
    """

    knots: Array
    first: float
    rate: float


class FrameScene(NamedTuple):
    """One parameter vector before one instrument.

    Attributes
    ----------
    shape : Shape
        The object.
    crosstalk : (float, float) or None
        [reading units].
    background : Background or None
        What lies behind the object.
    range_prior : RangePrior
        Of every frame's range.
    instrument : Instrument
        The sensor.
    flux_error : FluxError or None
        By what the object's flux differs from the model's.
    offset : float or None
        Range at a displacement of zero [m]; None where frames tell no displacement.
    """

    shape: Shape
    crosstalk: Pair | None
    background: Background | None
    range_prior: RangePrior
    instrument: Instrument
    flux_error: FluxError | None
    offset: float | None = None


class Rows(NamedTuple):
    """Many parameter vectors, one a row: what `scene_of` opens.

    Attributes
    ----------
    shapes : ndarray, shape (n, 3)
        As `Shape`.
    crosstalks : ndarray, shape (n, 2), or None
        [reading units].
    backgrounds : ndarray, shape (n, 4), or None
        As `Background`.
    range_priors : ndarray, shape (n, 8)
        As the numbers of `RangePrior`.
    resolves : bool
        As `RangePrior.resolves`, the same for all.
    flux_errors : ndarray, shape (n, knots, 2), or None
        Knots of a `FluxError` each.
    flux_grid : (float, float) or None
        First knot and rate of all of them.
    offsets : ndarray, shape (n,), or None
        As `FrameScene.offset`.
    lags : ndarray, shape (n,), or None
        Of the sensor, in place of its phase offset [rad] or the length of its timing offset [m],
        where that is unknown.
    """

    shapes: Array
    crosstalks: Array | None
    backgrounds: Array | None
    range_priors: Array
    resolves: bool = False
    flux_errors: Array | None = None
    flux_grid: Pair | None = None
    offsets: Array | None = None
    lags: Array | None = None


def instrument_of(sensor: Sensor) -> Instrument:
    """Return a sensor as the kernels take it.

    Shot and relative noise of size zero are none where both are: one machine code does for one of
    them and for both.
    """
    r0, wave = instrument(sensor)
    noise = sensor.noise
    varies = noise.shot > 0.0 or noise.relative > 0.0
    shot, relative = (noise.shot, noise.relative) if varies else (None, None)
    return Instrument(r0, wave, noise.read, shot, relative, noise.flickers)


def prior_of(numbers: Array) -> RangePrior:
    """Return a row of `simulator.parameters.Terms.ranges` as a prior, not a reference prior."""
    constant, power, mean, inverse_sd, log_mean, log_inverse_sd, low, high = numbers.tolist()
    return RangePrior(constant, power, mean, inverse_sd, log_mean, log_inverse_sd, low, high, False)


def row_of(rows: Rows, i: int) -> Rows:
    """Return row i as rows of one vector."""
    one = slice(i, i + 1)
    return Rows(
        rows.shapes[one],
        None if rows.crosstalks is None else rows.crosstalks[one],
        None if rows.backgrounds is None else rows.backgrounds[one],
        rows.range_priors[one],
        rows.resolves,
        None if rows.flux_errors is None else rows.flux_errors[one],
        rows.flux_grid,
        None if rows.offsets is None else rows.offsets[one],
        None if rows.lags is None else rows.lags[one],
    )


@compiled
def scene_of(rows: Rows, instrument: Instrument, i: int) -> FrameScene:
    """Open parameter vector i."""
    shapes, priors = rows.shapes, rows.range_priors
    return FrameScene(
        Shape(shapes[i, 0], shapes[i, 1], shapes[i, 2]),
        _crosstalk_of(rows.crosstalks, i),
        _background_of(rows.backgrounds, i),
        RangePrior(
            priors[i, 0],
            priors[i, 1],
            priors[i, 2],
            priors[i, 3],
            priors[i, 4],
            priors[i, 5],
            priors[i, 6],
            priors[i, 7],
            rows.resolves,
            1.0,
        ),
        _instrument_of(instrument, instrument.r0, instrument.wave, rows.lags, i),
        _flux_error_of(rows.flux_errors, rows.flux_grid, i),
        _offset_of(rows.offsets, i),
    )


def _crosstalk_of(rows: Array | None, i: int) -> Pair | None:
    return None if rows is None else (float(rows[i, 0]), float(rows[i, 1]))


def _background_of(rows: Array | None, i: int) -> Background | None:
    if rows is None:
        return None
    return Background(float(rows[i, 0]), float(rows[i, 1]), float(rows[i, 2]), float(rows[i, 3]))


def _flux_error_of(knots: Array | None, grid: Pair | None, i: int) -> FluxError | None:
    return None if knots is None or grid is None else FluxError(knots[i], grid[0], grid[1])


def _offset_of(offsets: Array | None, i: int) -> float | None:
    return None if offsets is None else float(offsets[i])


def _instrument_of(
    of: Instrument, r0: Reach, wave: Pair | None, lags: Array | None, i: int
) -> Instrument:
    if lags is None:
        return of
    if wave is not None:
        wave = (wave[0], float(lags[i]))
    elif isinstance(r0, tuple):
        r0 = (r0[0], float(lags[i]))
    return Instrument(r0, wave, of.read, of.shot, of.relative, of.of_source)


@when_compiling
def _overload_members() -> None:
    from simulator.machine_code import is_none, overload

    @overload(_crosstalk_of)
    def _crosstalk(rows: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(rows):
            return lambda rows, i: None  # noqa: ARG005
        return lambda rows, i: (rows[i, 0], rows[i, 1])

    @overload(_background_of)
    def _background(rows: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(rows):
            return lambda rows, i: None  # noqa: ARG005
        return lambda rows, i: Background(rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])

    @overload(_flux_error_of)
    def _flux_error(knots: Any, grid: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(knots):
            return lambda knots, grid, i: None  # noqa: ARG005
        return lambda knots, grid, i: FluxError(knots[i], grid[0], grid[1])

    @overload(_instrument_of)
    def _instrument(of: Any, r0: Any, wave: Any, lags: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(lags):
            return lambda of, r0, wave, lags, i: of  # noqa: ARG005
        if is_none(wave):
            return lambda of, r0, wave, lags, i: Instrument(  # noqa: ARG005
                (r0[0], lags[i]), None, of.read, of.shot, of.relative, of.of_source
            )
        return lambda of, r0, wave, lags, i: Instrument(  # noqa: ARG005
            of.r0, (wave[0], lags[i]), of.read, of.shot, of.relative, of.of_source
        )

    @overload(_offset_of)
    def _offset(offsets: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(offsets):
            return lambda offsets, i: None  # noqa: ARG005
        return lambda offsets, i: offsets[i]
