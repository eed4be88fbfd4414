"""What a frame says of the error of the object's flux: slopes and curvatures along it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.range_integral import falls_off
from inference.frame.arguments import FluxError, FrameScene, Instrument, Pair
from inference.frame.blocks import Block, frame_of
from inference.frame.flux_error import cubic_weights, slope_weights
from inference.frame.gaussian import (
    covariance_slope,
    gaussian,
    precision_product,
    squared_cross,
)
from inference.frame.known_range import known_information, known_log_density, known_slope
from inference.frame.mean_readings import Along, readings_along
from inference.frame.modes import LEFT, POSITION, RIGHT, SD, TOP
from inference.frame.range_prior import (
    LEAST_INFORMATION,
    log_range_density,
    log_resolved,
    prior_curvature,
    prior_slope,
)
from simulator.compiled import compiled

__all__ = [
    "Expansion",
    "FluxFunctions",
    "add_mode",
    "add_row",
    "add_slopes",
    "expand",
    "information_slopes",
]

Array = NDArray[np.float64]

_NEARLY_GAUSSIAN = 3e-3  # standard deviation of log r, as for the frame integral
_NARROW = 0.3
_STEP, _HALF = 0.7, 7  # of the trapezoidal rule
_SIDE = 24  # points on either side of a mode that is not narrow
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


class FluxFunctions(NamedTuple):
    """The error of the object's flux as a sum of functions.

    Attributes
    ----------
    basis : ndarray, shape (knots, 2, functions)
        Knots of the functions, multiplied by the standard deviation of the error.
    error : FluxError
        Their sum under coefficients, which kernels fill in.
    """

    basis: Array
    error: FluxError


class Expansion(NamedTuple):
    """A frame's log density around a point, in log r and in the logarithm of the flux.

    Curvatures hold the covariance fixed.

    Attributes
    ----------
    density : float
        Log density.
    along, bend : float
        Slope, without that of a reference prior, and curvature along log r.
    flux, stiff : float
        Slope and curvature along log flux.
    mixed : float
        Mixed curvature.
    free : float
        Curvature along log flux with log r free to follow.
    turn : float
        Slope along the slope of log flux, which only a reference prior of the range feels.
    darkness : float
        Slope along the log of a reference prior's law in the dark.
    """

    density: float
    along: float
    bend: float
    flux: float
    mixed: float
    stiff: float
    free: float
    turn: float
    darkness: float


@compiled
def expand(u: float, block: Block, scene: FrameScene) -> Expansion:
    """Expand a frame's log density in log r and in the logarithm of the flux.

    Parameters
    ----------
    u, block, scene
        As for `inference.frame.log_density.log_density`; a block of one.
    """
    r, prior, instrument = math.exp(u), scene.range_prior, scene.instrument
    first, second, gain, known = frame_of(block, 0)
    signal, signal_slope, mean, slope = readings_along(u, r, gain, scene)
    residual = first - mean[0], second - mean[1]
    density = gaussian(residual, mean, signal, instrument)
    density += log_range_density(r, u, prior) + known_log_density(r, known, scene.offset)
    along = precision_product(residual, slope, mean, signal, instrument) + prior_slope(r, u, prior)
    along += covariance_slope(residual, mean, slope, signal, signal_slope, instrument)
    along += known_slope(r, known, scene.offset)
    flux = precision_product(residual, signal, mean, signal, instrument)
    flux += covariance_slope(residual, mean, signal, signal, signal, instrument)
    of_logarithm, of_range = prior_curvature(r, prior)
    told = known_information(r, known)
    held = of_logarithm + of_range + told
    told_by_light = precision_product(slope, slope, mean, signal, instrument)
    bend = told_by_light + held
    mixed = precision_product(slope, signal, mean, signal, instrument)
    stiff = precision_product(signal, signal, mean, signal, instrument)
    # what is left once u has followed, as a sum of squares (Lagrange's identity)
    free = stiff
    if bend > 0.0:
        cross = squared_cross(slope, signal, mean, signal, instrument)
        free = (cross + held * stiff) / bend
    along_flux = Along(signal, signal_slope, mean, slope)
    resolved, pushed, turn, darkness = _resolution(told_by_light + told, along_flux, scene)
    density, flux = density + resolved, flux + pushed
    return Expansion(density, along, bend, flux, mixed, stiff, free, turn, darkness)


@compiled
def _resolution(
    information: float, along: Along, scene: FrameScene
) -> tuple[float, float, float, float]:
    """Return what a reference prior adds to density, slope along log flux, turn and darkness."""
    if not scene.range_prior.resolves:
        return 0.0, 0.0, 0.0, 0.0
    pushed, turned = information_slopes(along, scene.instrument)
    dark = scene.range_prior.dark
    whole, lit = LEAST_INFORMATION + information, dark * LEAST_INFORMATION + information
    rate = 2.0 / lit - 1.0 / whole
    density = log_resolved(information / LEAST_INFORMATION, dark)
    return density, rate * pushed, rate * turned, dark * LEAST_INFORMATION / lit


@compiled
def information_slopes(along: Along, instrument: Instrument) -> Pair:
    """Return half the slopes of a frame's information on log r along log flux, and its slope."""
    signal, signal_slope, mean, slope = along
    pushed = precision_product(signal_slope, slope, mean, signal, instrument)
    # shot and relative noise grow with the flux: the same curve then tells less
    pushed -= covariance_slope(slope, mean, signal, signal, signal, instrument)
    pushed += covariance_slope((0.0, 0.0), mean, signal, signal, signal, instrument)
    return pushed, precision_product(signal, slope, mean, signal, instrument)


@compiled
def add_row(out: Array, functions: FluxFunctions, u: float, scale: float) -> None:
    """Add scale times all basis functions at u."""
    basis, error = functions
    i, a, b, c, d = cubic_weights(u, error.first, error.rate, basis.shape[0])
    a, b, c, d = scale * a, scale * b, scale * c, scale * d
    for k in range(out.size):
        out[k] += (
            a * basis[i, 0, k]
            + b * basis[i, 1, k]
            + c * basis[i + 1, 0, k]
            + d * basis[i + 1, 1, k]
        )


@compiled
def add_slopes(out: Array, functions: FluxFunctions, u: float, scale: float) -> None:
    """Add scale times the slopes of all basis functions at u."""
    basis, error = functions
    i, a, b, c = slope_weights(u, error.first, error.rate, basis.shape[0])
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
    block: Block,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Add what one mode of a frame says of the coefficients of the flux error.

    Parameters
    ----------
    gradient : ndarray, shape (functions,)
        Added to: the mode's share of the derivative of the frame's log likelihood.
    row : ndarray, shape (functions,)
        Filled; row row^T is its share of the information.
    weight : float
        The mode's share of the frame's mass.
    mode : ndarray
        From `inference.frame.modes.find_modes`.
    block, scene
        As for `expand`.
    functions : FluxFunctions
        Of which the scene's flux error is made.

    Returns
    -------
    float
        The mode's share of the slope along the log of a reference prior's law in the dark.
    """
    u, top, sd = mode[POSITION], mode[TOP], mode[SD]
    row[:] = 0.0
    if sd < _NARROW and falls_off(mode, block, scene):
        total, pull, turn, darkness = 0.0, 0.0, 0.0, 0.0
        half = _NODES.size // 2 if sd < _NEARLY_GAUSSIAN else _HALF
        for j in range(-half, half + 1):
            x = _NODES[j + half] if sd < _NEARLY_GAUSSIAN else j * _STEP
            found = expand(u + x * sd, block, scene)
            if sd < _NEARLY_GAUSSIAN:
                share = _WEIGHTS[j + half] * math.exp(min(found.density - top + 0.5 * x * x, 1.0))
            else:
                share = math.exp(found.density - top)
            total += share
            pull += share * found.flux
            # the functions are straight over so narrow a mode
            turn += share * (found.flux * x * sd + found.turn)
            darkness += share * found.darkness
        free = expand(u, block, scene).free
        add_row(gradient, functions, u, weight * pull / total)
        add_slopes(gradient, functions, u, weight * turn / total)
        add_row(row, functions, u, math.sqrt(weight * free))
        return weight * darkness / total
    total, mean, square, stiff, darkness = 0.0, 0.0, 0.0, 0.0, 0.0
    for repeat in range(2):  # the total first: shares of it go into the gradient
        whole = total
        for side in range(2):
            sign = -1.0 if side == 0 else 1.0
            length = u - mode[LEFT] if side == 0 else mode[RIGHT] - u
            scale = min(sd, length)
            if not scale > 0.0:
                continue
            growth = math.asinh(length / scale) / _SIDE
            for j in range(_SIDE + 1):
                at = u + sign * scale * math.sinh(growth * j)
                at = min(max(at, mode[LEFT]), mode[RIGHT])
                width = scale * growth * math.cosh(growth * j)
                if j == 0 or j == _SIDE:
                    width *= 0.5
                found = expand(at, block, scene)
                share = width * math.exp(min(found.density - top, 50.0))
                if repeat == 0:
                    total += share
                    mean += share * found.flux
                    square += share * found.flux * found.flux
                    stiff += share * found.stiff
                    darkness += share * found.darkness
                elif share > 0.0:
                    add_row(gradient, functions, at, weight * share / whole * found.flux)
                    if found.turn != 0.0:
                        add_slopes(gradient, functions, at, weight * share / whole * found.turn)
        if not total > 0.0:
            return 0.0
    mean, square, stiff = mean / total, square / total, stiff / total
    left = max(stiff - (square - mean * mean), 0.0)
    add_row(row, functions, u, math.sqrt(weight * left))
    return weight * darkness / total
