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

from inference.density.gaussian import Pair
from inference.fits.likelihood.slopes import SLOTS, frame_slopes
from simulator.compiled import compiled
from simulator.readings import noise_parts

__all__ = ["linearise", "whitened_slopes"]

Array = NDArray[np.float64]


@compiled
def _whiten(
    rows: Array,
    slopes: Array,
    frame: Pair,
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
) -> None:
    """Fill one frame's rows: columns are slots, log r, and last the residual."""
    top = SLOTS + 1
    mean = (slopes[top, 0], slopes[top, 1])
    signal = (slopes[top, 2], slopes[top, 3])
    own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
    first = own1 + shared + s1 * s1
    cross = shared + s1 * s2
    # the determinant as a sum of squares: nothing cancels (`inference.density.integrand`)
    determinant = own1 * own2 + shared * (own1 + own2) + own2 * s1 * s1 + own1 * s2 * s2
    determinant += shared * (s1 - s2) ** 2
    root = math.sqrt(first)
    i11, i22 = 1.0 / root, root / math.sqrt(determinant)
    i21 = -cross / root / math.sqrt(determinant)
    w1 = i11 * (frame[0] - mean[0])
    w2 = i21 * (frame[0] - mean[0]) + i22 * (frame[1] - mean[1])
    rows[0, top], rows[1, top] = w1, w2
    for k in range(top):
        rows[0, k] = i11 * slopes[k, 0]
        rows[1, k] = i21 * slopes[k, 0] + i22 * slopes[k, 1]
    if shot is not None and relative is not None:
        half = math.sqrt(0.5)
        rows[2, top], rows[3, top], rows[4, top] = (
            half * (w1 * w1 - 1.0),
            half * (w2 * w2 - 1.0),
            w1 * w2,
        )
        for k in range(top):
            d1 = shot * slopes[k, 0] * math.copysign(1.0, mean[0])
            d2 = shot * slopes[k, 1] * math.copysign(1.0, mean[1])
            d12 = 0.0
            if pulsed:
                d12 = d1 if abs(mean[0]) < abs(mean[1]) else d2
            t1, t2 = relative * slopes[k, 2], relative * slopes[k, 3]
            v11, v22 = d1 + 2.0 * s1 * t1, d2 + 2.0 * s2 * t2
            v12 = d12 + s1 * t2 + s2 * t1
            a11 = i11 * i11 * v11
            a12 = i11 * (i21 * v11 + i22 * v12)
            a22 = i21 * i21 * v11 + 2.0 * i21 * i22 * v12 + i22 * i22 * v22
            rows[2, k], rows[3, k], rows[4, k] = half * a11, half * a22, a12


@compiled
def _along_coordinates(out: Array, rows: Array, a: int, slopes_of_values: Array) -> None:
    """Fill one whitened row along the coordinates from that along the slots."""
    for j in range(slopes_of_values.shape[1]):
        total = 0.0
        for k in range(SLOTS):
            total += rows[a, k] * slopes_of_values[k, j]
        out[j] = total


@compiled
def linearise(
    matrix: Array,
    values: Array,
    slopes_of_values: Array,
    positions: Array,
    frames: Array,
    inside: Pair,
    gain: float,
    background: bool | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill the projected rows of all frames.

    Parameters
    ----------
    matrix : ndarray, shape (frames * m, d + 1)
        m is 5 where noise depends on the mean, else 2. Filled: slopes of the model along each
        coordinate, and the residuals.
    values : ndarray, shape (SLOTS + 1,)
        Physical values (`coordinates.physical`); the last entry is work space.
    slopes_of_values : ndarray, shape (SLOTS, d)
        From `coordinates.chain`.
    positions : ndarray, shape (frames,)
        log r; nan without an object.
    frames : ndarray, shape (frames, 3)
        Readings and gain factor.
    inside : (float, float)
        log r beyond which a range lies at the end of its support and cannot give way.
    gain, background, r0, wave, read, shot, relative
        Sensor and scene.
    """
    d = slopes_of_values.shape[1]
    m = 2 if shot is None else 5
    slopes = np.empty((SLOTS + 2, 4))
    rows = np.zeros((5, SLOTS + 2))
    for i in range(frames.shape[0]):
        u = positions[i]
        values[SLOTS] = frames[i, 2]
        frame_slopes(slopes, u, values, gain, background, r0, wave)
        _whiten(rows, slopes, (frames[i, 0], frames[i, 1]), read, shot, relative, wave is None)
        first = i * m
        length = 0.0
        for a in range(m):
            _along_coordinates(matrix[first + a], rows, a, slopes_of_values)
            matrix[first + a, d] = rows[a, SLOTS + 1]
            length += rows[a, SLOTS] ** 2
        if not (math.isfinite(u) and length > 0.0 and inside[0] < u < inside[1]):
            continue
        for j in range(d + 1):
            along = 0.0
            for a in range(m):
                along += rows[a, SLOTS] * matrix[first + a, j]
            along /= length
            for a in range(m):
                matrix[first + a, j] -= along * rows[a, SLOTS]


@compiled
def whitened_slopes(
    jacobian: Array,
    along_range: Array,
    residual: Array,
    values: Array,
    slopes_of_values: Array,
    positions: Array,
    frames: Array,
    inside: Pair,
    gain: float,
    background: bool | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
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
    values, slopes_of_values, positions, frames, inside
        As for `linearise`.
    gain, background, r0, wave, read, shot, relative
        Sensor and scene.
    """
    slopes = np.empty((SLOTS + 2, 4))
    rows = np.zeros((5, SLOTS + 2))
    for i in range(frames.shape[0]):
        u = positions[i]
        values[SLOTS] = frames[i, 2]
        frame_slopes(slopes, u, values, gain, background, r0, wave)
        _whiten(rows, slopes, (frames[i, 0], frames[i, 1]), read, shot, relative, wave is None)
        for a in range(2):
            _along_coordinates(jacobian[i, a], rows, a, slopes_of_values)
            residual[i, a] = rows[a, SLOTS + 1]
            along_range[i, a] = math.nan
            if math.isfinite(u):
                along_range[i, a] = rows[a, SLOTS] if inside[0] < u < inside[1] else 0.0
