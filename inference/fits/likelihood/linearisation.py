"""Whitened residuals of all frames and their slopes, every range eliminated.

Where noise depends on the mean (shot, relative), three more rows a frame carry what the covariance
tells: with L L^T the covariance, w the whitened residual and A = L^-1 V' L^-T for a slope V', rows
A / sqrt 2 against (w w^T - 1) / sqrt 2. Least squares of all five rows is Fisher scoring on the
likelihood, determinant included. The direction along a frame's range is projected out of its rows,
which is the Schur complement of the ranges in the information matrix.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import SLOTS, Bounds, Fit, Place
from inference.fits.likelihood.coordinates import bounds_of, chain
from inference.fits.likelihood.deviance import POSITION, nearest_range
from inference.frame.arguments import Instrument, Pair
from inference.frame.noise import NoiseParts, Triangle, noise_of, whitener
from inference.frame.sensitivity import SLOPES, Value, fill_slopes
from simulator.compiled import compiled
from simulator.readings import light_that_errs

__all__ = [
    "fill_projected",
    "frame_rows",
    "room_for_rows",
    "rows_of",
    "whitened_slopes",
    "yielding_ranges",
]

Array = NDArray[np.float64]
Triple = tuple[float, float, float]

# columns of frames, and of slopes: the readings, then the object's part of them
_FIRST, _SECOND, _GAIN = 0, 1, 2
_SIGNAL_1, _SIGNAL_2 = 2, 3
_READINGS = 2  # rows of a frame that are whitened readings
_ALL = 5  # rows where the covariance tells something, too
_EDGE = 1e-9  # in log r from the end of its support, where a range cannot give way


@compiled
def rows_of(frames: int, instrument: Instrument) -> int:
    """Return how many rows so many frames have."""
    return frames * (_READINGS if instrument.shot is None else _ALL)


@compiled
def _add_covariance(
    rows: Array,
    slopes: Array,
    noise: NoiseParts,
    white: Triangle,
    pulsed: bool,
    shot: float | None,
    relative: float | None,
    of_source: bool,
) -> None:
    """Fill the rows of what the covariance tells, those of the readings given."""
    if shot is not None and relative is not None:
        half = math.sqrt(0.5)
        i11, i21, i22 = white
        s1, s2 = noise.common1, noise.common2
        top = Value.READINGS
        mean1, mean2 = slopes[top, _FIRST], slopes[top, _SECOND]
        w1, w2 = rows[0, top], rows[1, top]
        rows[2, top], rows[3, top], rows[4, top] = (
            half * (w1 * w1 - 1.0),
            half * (w2 * w2 - 1.0),
            w1 * w2,
        )
        for k in range(Value.READINGS):
            d1 = shot * slopes[k, _FIRST] * math.copysign(1.0, mean1)
            d2 = shot * slopes[k, _SECOND] * math.copysign(1.0, mean2)
            d12 = 0.0
            if pulsed:
                d12 = d1 if abs(mean1) < abs(mean2) else d2
            errs = light_that_errs(
                (slopes[k, _FIRST], slopes[k, _SECOND]),
                (slopes[k, _SIGNAL_1], slopes[k, _SIGNAL_2]),
                of_source,
            )
            t1, t2 = relative * errs[0], relative * errs[1]
            v11, v22 = d1 + 2.0 * s1 * t1, d2 + 2.0 * s2 * t2
            v12 = d12 + s1 * t2 + s2 * t1
            a11 = i11 * i11 * v11
            a12 = i11 * (i21 * v11 + i22 * v12)
            a22 = i21 * i21 * v11 + 2.0 * i21 * i22 * v12 + i22 * i22 * v22
            rows[2, k], rows[3, k], rows[4, k] = half * a11, half * a22, a12


@compiled
def _whiten(rows: Array, slopes: Array, frame: Pair, instrument: Instrument) -> None:
    """Fill one frame's rows; columns are those of `Value`, the residual in place of readings."""
    top = Value.READINGS
    mean = (slopes[top, _FIRST], slopes[top, _SECOND])
    noise = noise_of(mean, (slopes[top, _SIGNAL_1], slopes[top, _SIGNAL_2]), instrument)
    white = whitener(noise)
    i11, i21, i22 = white
    e1, e2 = frame[0] - mean[0], frame[1] - mean[1]
    rows[0, top], rows[1, top] = i11 * e1, i21 * e1 + i22 * e2
    for k in range(Value.READINGS):
        rows[0, k] = i11 * slopes[k, _FIRST]
        rows[1, k] = i21 * slopes[k, _FIRST] + i22 * slopes[k, _SECOND]
    pulsed = instrument.wave is None
    shot, relative, of_source = instrument.shot, instrument.relative, instrument.of_source
    _add_covariance(rows, slopes, noise, white, pulsed, shot, relative, of_source)


@compiled
def _fill_frame(
    rows: Array,
    slopes: Array,
    frame: Triple,
    u: float,
    values: Array,
    gain: float,
    background: bool | None,
    instrument: Instrument,
) -> None:
    """Fill the slopes and the whitened rows of a frame at log range u.

    It takes members of `Fit` alone: numba counts references to the arrays of all others.
    """
    first, second, factor = frame
    fill_slopes(slopes, u, values, gain, factor, background, instrument)
    _whiten(rows, slopes, (first, second), instrument)


@compiled
def room_for_rows() -> tuple[Array, Array]:
    """Return room for the slopes and the whitened rows of a frame."""
    return np.empty((SLOPES, 4)), np.zeros((_ALL, SLOPES))


@compiled
def frame_rows(rows: Array, slopes: Array, i: int, u: float, values: Array, fit: Fit) -> None:
    """Fill the whitened rows of frame i at log range u along the physical values.

    Parameters
    ----------
    rows, slopes : ndarray
        From `room_for_rows`. Columns of the rows are those of `Value`, the residual in place of
        readings.
    i : int
        The frame.
    u : float
        log r; nan without an object.
    values : ndarray, shape (SLOTS,)
        Physical values.
    fit : Fit
        The fit.
    """
    frames = fit.data.frames
    frame = (frames[i, _FIRST], frames[i, _SECOND], frames[i, _GAIN])
    _fill_frame(rows, slopes, frame, u, values, fit.gain, fit.background, fit.instrument)


@compiled
def _along_coordinates(out: Array, rows: Array, a: int, chained: Array) -> None:
    """Fill one whitened row along the coordinates from that along the physical values."""
    for j in range(chained.shape[1]):
        total = 0.0
        for k in range(SLOTS):
            total += rows[a, k] * chained[k, j]
        out[j] = total


@compiled
def yielding_ranges(values: Array, fit: Fit) -> Pair:
    """Return the log ranges between which a range can give way."""
    near = nearest_range(values, fit.support[0], fit.background)
    return math.log(near) + _EDGE, math.log(fit.support[1]) - _EDGE


@compiled
def fill_projected(matrix: Array, place: Place, bounds: Bounds, fit: Fit) -> None:
    """Fill the projected rows of all frames, and the bounds.

    Parameters
    ----------
    matrix : ndarray, shape (`rows_of` the frames, d + 1)
        Filled: slopes of the model along each coordinate, and the residuals.
    place : Place
        From `deviance`.
    bounds : Bounds
        Filled.
    fit : Fit
        The fit.
    """
    values, d = place.values, place.x.size
    bounds_of(bounds, values, fit.layout)
    chained = np.empty((SLOTS, d))
    chain(chained, values, place.x, fit.layout, bounds)
    frames, gain, background, instrument = fit.data.frames, fit.gain, fit.background, fit.instrument
    low, high = yielding_ranges(values, fit)
    n = frames.shape[0]
    m = matrix.shape[0] // n
    slopes, rows = np.empty((SLOPES, 4)), np.zeros((_ALL, SLOPES))
    for i in range(n):
        u = place.best[0, i, POSITION]
        frame = (frames[i, _FIRST], frames[i, _SECOND], frames[i, _GAIN])
        _fill_frame(rows, slopes, frame, u, values, gain, background, instrument)
        first = i * m
        length = 0.0
        for a in range(m):
            _along_coordinates(matrix[first + a], rows, a, chained)
            matrix[first + a, d] = rows[a, Value.READINGS]
            length += rows[a, Value.LOG_RANGE] * rows[a, Value.LOG_RANGE]
        if not (math.isfinite(u) and length > 0.0 and low < u < high):
            continue
        for j in range(d + 1):
            along = 0.0
            for a in range(m):
                along += rows[a, Value.LOG_RANGE] * matrix[first + a, j]
            along /= length
            for a in range(m):
                matrix[first + a, j] -= along * rows[a, Value.LOG_RANGE]


@compiled
def whitened_slopes(
    jacobian: Array,
    along_range: Array,
    residual: Array,
    values: Array,
    chained: Array,
    positions: Array,
    fit: Fit,
) -> None:
    """Fill whitened residuals of the readings and their model's slopes, nothing projected out.

    Parameters
    ----------
    jacobian : ndarray, shape (frames, 2, d)
        Filled: along each coordinate.
    along_range : ndarray, shape (frames, 2)
        Filled: along log r; 0 for a range at the end of its support, nan without an object.
    residual : ndarray, shape (frames, 2)
        Filled.
    values : ndarray, shape (SLOTS,)
        From `coordinates.physical`.
    chained : ndarray, shape (SLOTS, d)
        From `coordinates.chain`.
    positions : ndarray, shape (frames,)
        log r; nan without an object.
    fit : Fit
        The fit.
    """
    frames, gain, background, instrument = fit.data.frames, fit.gain, fit.background, fit.instrument
    low, high = yielding_ranges(values, fit)
    slopes, rows = np.empty((SLOPES, 4)), np.zeros((_ALL, SLOPES))
    for i in range(positions.size):
        u = positions[i]
        frame = (frames[i, _FIRST], frames[i, _SECOND], frames[i, _GAIN])
        _fill_frame(rows, slopes, frame, u, values, gain, background, instrument)
        for a in range(_READINGS):
            _along_coordinates(jacobian[i, a], rows, a, chained)
            residual[i, a] = rows[a, Value.READINGS]
            along_range[i, a] = math.nan
            if math.isfinite(u):
                along_range[i, a] = rows[a, Value.LOG_RANGE] if low < u < high else 0.0
