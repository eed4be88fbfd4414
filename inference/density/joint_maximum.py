"""The joint maximum over the flux error's coefficients and all ranges, for given parameters.

Gauss-Newton steps in the coefficients with every range eliminated; after a step the ranges follow.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.best_ranges import BEST_DENSITY, BEST_LOG_RANGE, BEST_SD
from inference.density.flux_expansion import FluxFunctions, add_row, expand
from inference.density.range_integral import best_mode
from inference.density.triangular import cholesky, solve_factor
from inference.frame.arguments import (
    FluxError,
    FrameScene,
    Instrument,
    Pair,
    Rows,
    scene_of,
)
from inference.frame.blocks import Block, Data, block_of, is_empty
from inference.frame.flux_error import fill_knots
from inference.frame.gaussian import log_top
from inference.frame.log_density import empty_log_likelihood, log_density, slope_and_curvature
from inference.frame.modes import POSITION, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.assign import assign
from simulator.compiled import compiled

__all__ = [
    "best_positions",
    "climb_jointly",
    "fill_joint_maxima",
    "with_error",
]

Array = NDArray[np.float64]

_CLIMBS = 15
_FOLLOWING = 4  # steps of a range after one of the curve
_NEAR = 1e-2  # nats that are left to Newton's method
_LONGEST = 1.0  # of a step, in log flux
_LONGEST_RANGE = 0.5  # of a step, in log r
_SHORTER = 0.3  # share of a step that is left when it leads downhill

# what is kept of a frame: slope and curvature along log r, and the curvature mixed with log flux
_ALONG, _BEND, _MIXED = 0, 1, 2


class NormalEquations(NamedTuple):
    """Of a Gauss-Newton step in the coefficients, every range eliminated.

    Attributes
    ----------
    precision : ndarray, shape (functions, functions)
        The upper triangle is filled.
    gradient : ndarray, shape (functions,)
        Along the coefficients.
    phi : ndarray, shape (frames, functions)
        The functions at the frames' ranges.
    ranges : ndarray, shape (frames, 3)
        Of each frame slope and curvature along log r, and the curvature mixed with log flux.
    """

    precision: Array
    gradient: Array
    phi: Array
    ranges: Array


@compiled
def with_error(scene: FrameScene, error: FluxError) -> FrameScene:
    """Return a scene whose object's flux has an error."""
    return FrameScene(
        scene.shape,
        scene.crosstalk,
        scene.background,
        scene.range_prior,
        scene.instrument,
        error,
        scene.offset,
    )


@compiled
def best_positions(positions: Array, data: Data, scene: FrameScene) -> None:
    """Fill log r of every frame's best mode under the scene's curve; nan without an object."""
    table = tabulate(integration_bounds(scene.range_prior), scene, data.strongest)
    work = np.empty(table.shape[1])
    modes = room_for_modes(table)
    for j in range(positions.size):
        positions[j] = math.nan
        if is_empty(data, j):
            continue
        best = best_mode(modes, find_modes(modes, work, table, block_of(data, j), scene))
        if best >= 0:
            positions[j] = modes[best, POSITION]


@compiled
def _step_of(slope: float, bend: float, u: float, bounds: Pair) -> float:
    """Return where a step of bounded length leads within bounds."""
    step = min(max(slope / bend, -_LONGEST_RANGE), _LONGEST_RANGE)
    return min(max(u + step, bounds[0]), bounds[1])


@compiled
def _follow(u: float, block: Block, bounds: Pair, scene: FrameScene) -> float:
    """Let a range follow a change of the curve, by Gauss-Newton steps."""
    for _ in range(_FOLLOWING):
        slope, bend = slope_and_curvature(u, block, scene)
        if not bend > 0.0 or slope * slope < 1e-2 * bend:
            break
        u = _step_of(slope, bend, u, bounds)
    return u


@compiled
def _prepare(
    equations: NormalEquations,
    at: Array,
    coefficients: Array,
    data: Data,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Let ranges follow the curve and fill the normal equations; return the log density."""
    precision, gradient, phi, ranges = equations
    bounds, size = integration_bounds(scene.range_prior), gradient.size
    fill_knots(functions.error.knots, functions.basis, coefficients)
    value = 0.0
    precision[:] = 0.0
    for k in range(size):
        value -= 0.5 * coefficients[k] * coefficients[k]
        precision[k, k] = 1.0
        gradient[k] = -coefficients[k]
    for j in range(at.size):
        if not math.isfinite(at[j]):
            continue
        block = block_of(data, j)
        at[j] = _follow(at[j], block, bounds, scene)
        density, along, bend, flux, mixed, stiff, free, _, _ = expand(at[j], block, scene)
        value += density
        # at an end of the support, or where nothing bends, the range cannot follow
        stuck = (at[j] <= bounds[0] and along < 0.0) or (at[j] >= bounds[1] and along > 0.0)
        if stuck or not bend > 0.0:
            along, bend, mixed, free = 0.0, 1.0, 0.0, stiff
        ranges[j, _ALONG], ranges[j, _BEND], ranges[j, _MIXED] = along, bend, mixed
        phi[j, :] = 0.0
        add_row(phi[j], functions, at[j], 1.0)
        slope = flux - mixed * along / bend
        for k in range(size):
            gradient[k] += slope * phi[j, k]
            scaled = free * phi[j, k]
            for i in range(k, size):
                precision[k, i] += scaled * phi[j, i]
    return value


@compiled
def climb_jointly(
    coefficients: Array,
    positions: Array,
    data: Data,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Climb to the joint maximum over coefficients and ranges; return its log density."""
    n, size = positions.size, coefficients.size
    bounds = integration_bounds(scene.range_prior)
    equations = NormalEquations(
        np.empty((size, size)), np.empty(size), np.empty((n, size)), np.empty((n, 3))
    )
    step, phi, ranges = equations.gradient, equations.phi, equations.ranges
    moves = np.zeros(n)
    best, trial, at = -math.inf, coefficients.copy(), positions.copy()
    for _ in range(_CLIMBS):
        value = _prepare(equations, at, trial, data, scene, functions)
        if not value > best:
            for k in range(size):
                trial[k] = coefficients[k] + _SHORTER * (trial[k] - coefficients[k])
            for j in range(n):
                at[j] = positions[j] + _SHORTER * (at[j] - positions[j])
            continue
        best = value
        assign(coefficients, trial)
        assign(positions, at)
        if not cholesky(equations.precision):
            break
        gain = solve_factor(equations.precision, step)
        if gain < _NEAR:
            coefficients += step
            break
        longest = 0.0
        for j in range(n):
            if not math.isfinite(at[j]):
                continue
            change = 0.0
            for k in range(size):
                change += phi[j, k] * step[k]
            longest = max(longest, abs(change))
            moves[j] = change
        short = min(1.0, _LONGEST / longest) if longest > 0.0 else 1.0
        for k in range(size):
            trial[k] = coefficients[k] + short * step[k]
        for j in range(n):
            if math.isfinite(at[j]):
                pull = ranges[j, _ALONG] - ranges[j, _MIXED] * short * moves[j]
                at[j] = _step_of(pull, ranges[j, _BEND], at[j], bounds)
    return best


@compiled
def fill_joint_maxima(
    out: Array,
    centres: Array,
    rows: Rows,
    data: Data,
    instrument: Instrument,
    functions: FluxFunctions,
) -> None:
    """Fill the joint maximum over coefficients and ranges of every parameter vector.

    Parameters
    ----------
    out : ndarray, shape (n, frames, 3)
        Filled with log r, the frame's share of the joint log density, and the standard deviation of
        log r; nan, log likelihood and nan for a frame without object.
    centres : ndarray, shape (n, functions)
        Filled with the coefficients.
    rows, data, instrument
        Parameters, frames and sensor.
    functions : FluxFunctions
        What the error is made of; its sum is overwritten.
    """
    n = out.shape[1]
    positions = np.empty(n)
    for i in range(out.shape[0]):
        scene = with_error(scene_of(rows, instrument, i), functions.error)
        bounds = integration_bounds(scene.range_prior)
        centre = centres[i]
        centre[:] = 0.0
        out[i, :, BEST_LOG_RANGE], out[i, :, BEST_SD] = math.nan, math.nan
        out[i, :, BEST_DENSITY] = -math.inf
        if not bounds[1] > bounds[0]:
            continue
        fill_knots(functions.error.knots, functions.basis, centre)
        best_positions(positions, data, scene)
        climb_jointly(centre, positions, data, scene, functions)
        fill_knots(functions.error.knots, functions.basis, centre)
        prior = 0.0
        for k in range(centre.size):
            prior -= 0.5 * centre[k] * centre[k]
        for j in range(n):
            block = block_of(data, j)
            if is_empty(data, j):
                out[i, j, BEST_DENSITY] = prior / n + empty_log_likelihood(block, scene)
                continue
            if not math.isfinite(positions[j]):
                continue
            u = _follow(positions[j], block, bounds, scene)
            bend = slope_and_curvature(u, block, scene)[1]
            out[i, j, BEST_LOG_RANGE] = u
            out[i, j, BEST_DENSITY] = prior / n + log_density(u, block, scene)
            out[i, j, BEST_DENSITY] += log_top(instrument.read)
            out[i, j, BEST_SD] = 1.0 / math.sqrt(bend) if bend > 0.0 else math.inf
