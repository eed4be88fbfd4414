"""What a frame says of the error of the object's flux: slopes and curvatures along it."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.frame_integral import falls_off
from inference.density.gaussian import (
    Pair,
    covariance_slope,
    gaussian,
    precision_times,
    squared_cross,
)
from inference.density.integrand import (
    Law,
    Quad,
    ReferenceLaw,
    Triple,
    WarpedArguments,
    log_range_density,
    range_slope,
    readings_along,
)
from inference.density.warp import Curve, cubic_weights, slope_weights
from simulator.compiled import compiled

__all__ = ["add_mode", "add_row", "expand"]

Array = NDArray[np.float64]

_NEARLY_GAUSSIAN = 3e-3  # standard deviation of log r, as for the frame integral
_NARROW = 0.3
_STEP, _HALF = 0.7, 7  # of the trapezoidal rule
_SIDE = 24  # points on either side of a mode that is not narrow
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


@compiled
def expand(
    u: float,
    frame: Triple,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    law: Law | ReferenceLaw,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    delta: Curve,
) -> tuple[float, float, float, float, float, float, float, float]:
    """Expand a frame's log density in log r and in the logarithm of the flux.

    Parameters
    ----------
    u, frame, shape, crosstalk, background, law, r0, wave, read, shot, relative, delta
        As for `inference.density.integrand.log_integrand`.

    Returns
    -------
    tuple of eight floats
        Log density; slope and curvature along u; slope along log flux; mixed curvature; curvature
        along log flux; the same with u free to follow; slope along the slope of log flux, which
        only a reference prior of the range feels. Curvatures hold the covariance fixed; the slope
        along u is that without the reference prior.
    """
    r = math.exp(u)
    signal, signal_slope, mean, slope = readings_along(
        u, frame[2], shape, crosstalk, background, r0, wave, delta
    )
    e1, e2 = frame[0] - mean[0], frame[1] - mean[1]
    (o1, o2), (t1, t2) = signal, slope
    pulsed = wave is None
    density = gaussian((e1, e2), mean, signal, read, shot, relative, pulsed)
    density += log_range_density(r, u, law)
    p1, p2 = precision_times(slope, mean, signal, read, shot, relative, pulsed)
    q1, q2 = precision_times(signal, mean, signal, read, shot, relative, pulsed)
    pull = precision_times((e1, e2), mean, signal, read, shot, relative, pulsed)
    along = e1 * p1 + e2 * p2 + range_slope(r, u, law)
    along += covariance_slope(pull, mean, slope, signal, signal_slope, read, shot, relative, pulsed)
    flux = e1 * q1 + e2 * q2
    flux += covariance_slope(pull, mean, signal, signal, signal, read, shot, relative, pulsed)
    prior = law[5] * law[5] + r * r * law[3] * law[3]
    bend = t1 * p1 + t2 * p2 + prior
    mixed = t1 * q1 + t2 * q2
    stiff = o1 * q1 + o2 * q2
    # what is left once u has followed, as a sum of squares (Lagrange's identity)
    free = stiff
    if bend > 0.0:
        cross = squared_cross(slope, signal, mean, signal, read, shot, relative, pulsed)
        free = (cross + prior * stiff) / bend
    turn = 0.0
    if len(law) == 9:  # decided at compile time
        information = 1.0 + t1 * p1 + t2 * p2
        density += 0.5 * math.log(information)
        flux += (signal_slope[0] * p1 + signal_slope[1] * p2) / information
        turn = (o1 * p1 + o2 * p2) / information
    return density, along, bend, flux, mixed, stiff, free, turn


@compiled
def add_row(out: Array, basis: Array, u: float, delta: Curve, scale: float) -> None:
    """Add scale times all basis functions at u."""
    i, a, b, c, d = cubic_weights(u, delta[1], delta[2], basis.shape[0])
    a, b, c, d = scale * a, scale * b, scale * c, scale * d
    for k in range(out.size):
        out[k] += (
            a * basis[i, 0, k]
            + b * basis[i, 1, k]
            + c * basis[i + 1, 0, k]
            + d * basis[i + 1, 1, k]
        )


@compiled
def _add_slopes(out: Array, basis: Array, u: float, delta: Curve, scale: float) -> None:
    """Add scale times the slopes of all basis functions at u."""
    i, a, b, c = slope_weights(u, delta[1], delta[2], basis.shape[0])
    a, b, c = scale * a, scale * b, scale * c
    for k in range(out.size):
        rise = basis[i + 1, 0, k] - basis[i, 0, k]
        out[k] += a * rise + b * basis[i, 1, k] + c * basis[i + 1, 1, k]


@compiled
def add_mode(
    gradient: Array,
    row: Array,
    weight: float,
    mode: Array,
    frame: Triple,
    scene: WarpedArguments,
    basis: Array,
    delta: Curve,
) -> None:
    """Add what one mode of a frame says of the coefficients of the flux error.

    Parameters
    ----------
    gradient : ndarray, shape (functions,)
        Added to: the mode's share of the derivative of the frame's log likelihood.
    row : ndarray, shape (functions,)
        Filled; row row^T is its share of the information.
    weight : float
        The mode's share of the frame's mass.
    mode : ndarray, shape (6,)
        From `inference.density.range_modes.find_modes`.
    frame, scene
        As for `log_integrand`.
    basis : ndarray, shape (knots, 2, functions)
        Knots of the functions, multiplied by the standard deviation of the error.
    delta : Curve
        The scene's flux error.
    """
    u, top, sd = mode[0], mode[1], mode[2]
    row[:] = 0.0
    if sd < _NARROW and falls_off(mode, frame, scene):
        total, pull, turn = 0.0, 0.0, 0.0
        half = _NODES.size // 2 if sd < _NEARLY_GAUSSIAN else _HALF
        for j in range(-half, half + 1):
            x = _NODES[j + half] if sd < _NEARLY_GAUSSIAN else j * _STEP
            found = expand(u + x * sd, frame, *scene)
            if sd < _NEARLY_GAUSSIAN:
                share = _WEIGHTS[j + half] * math.exp(min(found[0] - top + 0.5 * x * x, 1.0))
            else:
                share = math.exp(found[0] - top)
            total += share
            pull += share * found[3]
            # the functions are straight over so narrow a mode
            turn += share * (found[3] * x * sd + found[7])
        free = expand(u, frame, *scene)[6]
        add_row(gradient, basis, u, delta, weight * pull / total)
        _add_slopes(gradient, basis, u, delta, weight * turn / total)
        add_row(row, basis, u, delta, math.sqrt(weight * free))
        return
    total, mean, square, stiff = 0.0, 0.0, 0.0, 0.0
    for repeat in range(2):  # the total first: shares of it go into the gradient
        whole = total
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            length = mode[0] - mode[3] if side == 0 else mode[4] - mode[0]
            scale = min(sd, length)
            if not scale > 0.0:
                continue
            growth = math.asinh(length / scale) / _SIDE
            for j in range(_SIDE + 1):
                at = u + sign * scale * math.sinh(growth * j)
                at = min(max(at, mode[3]), mode[4])
                width = scale * growth * math.cosh(growth * j)
                if j == 0 or j == _SIDE:
                    width *= 0.5
                found = expand(at, frame, *scene)
                share = width * math.exp(min(found[0] - top, 50.0))
                if repeat == 0:
                    total += share
                    mean += share * found[3]
                    square += share * found[3] * found[3]
                    stiff += share * found[5]
                elif share > 0.0:
                    add_row(gradient, basis, at, delta, weight * share / whole * found[3])
                    if len(scene[3]) == 9:  # decided at compile time
                        _add_slopes(gradient, basis, at, delta, weight * share / whole * found[7])
        if not total > 0.0:
            return
    mean, square, stiff = mean / total, square / total, stiff / total
    left = max(stiff - (square - mean * mean), 0.0)
    add_row(row, basis, u, delta, math.sqrt(weight * left))
