"""The joint maximum over the flux error's coefficients and all ranges, for given parameters.

Gauss-Newton steps in the coefficients with every range eliminated; after a step the ranges follow.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import empty_frame_log_likelihood
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.flux_error import add_row, expand
from inference.density.gaussian import Pair, log_top
from inference.density.integrand import Triple, WarpedArguments, log_integrand, slope_and_curvature
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.density.triangular import cholesky, solve_factor
from inference.density.warp import fill_curve
from simulator.compiled import compiled

__all__ = ["best_positions", "best_under_flux_error", "climb_jointly"]

Array = NDArray[np.float64]

_CLIMBS = 15
_FOLLOWING = 4  # steps of a range after one of the curve
_NEAR = 1e-2  # nats that are left to Newton's method
_LONGEST = 1.0  # of a step, in log flux


@compiled
def best_positions(
    positions: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    bounds: Pair,
    strongest: float,
    scene: WarpedArguments,
) -> None:
    """Fill log r of every frame's best mode under the scene's curve; nan without an object."""
    shape, crosstalk, background, law, r0, wave, read, shot, _, delta = scene
    table = tabulate(
        bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest, delta
    )
    work = np.empty(table.shape[1])
    modes = np.empty((work.size // 2 + 1, 6))
    for j in range(positions.size):
        positions[j] = math.nan
        if present is not None and not present[j]:
            continue
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        count = find_modes(modes, work, table, frame, scene)
        best = -math.inf
        for m in range(count):
            if modes[m, 1] > best:
                best, positions[j] = modes[m, 1], modes[m, 0]


@compiled
def _follow(u: float, frame: Triple, bounds: Pair, scene: WarpedArguments) -> float:
    """Let a range follow a change of the curve, by Gauss-Newton steps."""
    for _ in range(_FOLLOWING):
        slope, bend = slope_and_curvature(u, frame, *scene)
        if not bend > 0.0 or slope * slope < 1e-2 * bend:
            break
        u = min(max(u + min(max(slope / bend, -0.5), 0.5), bounds[0]), bounds[1])
    return u


@compiled
def climb_jointly(
    coefficients: Array,
    positions: Array,
    frames: Array,
    bounds: Pair,
    basis: Array,
    scene: WarpedArguments,
) -> float:
    """Climb to the joint maximum over coefficients and ranges; return its log density."""
    delta = scene[9]
    n, size = frames.shape[0], coefficients.size
    phi = np.empty((n, size))
    terms = np.empty((n, 3))
    precision = np.empty((size, size))
    step = np.empty(size)
    moves = np.zeros(n)
    best, trial, at = -math.inf, coefficients.copy(), positions.copy()
    for _ in range(_CLIMBS):
        fill_curve(delta[0], basis, trial)
        value = 0.0
        precision[:] = 0.0
        for k in range(size):
            value -= 0.5 * trial[k] * trial[k]
            precision[k, k] = 1.0
            step[k] = -trial[k]
        for j in range(n):
            if not math.isfinite(at[j]):
                continue
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            at[j] = _follow(at[j], frame, bounds, scene)
            density, along, bend, flux, mixed, stiff, free, _ = expand(at[j], frame, *scene)
            value += density
            # at an end of the support, or where nothing bends, the range cannot follow
            stuck = (at[j] <= bounds[0] and along < 0.0) or (at[j] >= bounds[1] and along > 0.0)
            if stuck or not bend > 0.0:
                along, bend, mixed, free = 0.0, 1.0, 0.0, stiff
            terms[j, 0], terms[j, 1], terms[j, 2] = along, bend, mixed
            phi[j, :] = 0.0
            add_row(phi[j], basis, at[j], delta, 1.0)
            slope = flux - mixed * along / bend
            for k in range(size):
                step[k] += slope * phi[j, k]
                scaled = free * phi[j, k]
                for i in range(k, size):
                    precision[k, i] += scaled * phi[j, i]
        if not value > best:
            for k in range(size):
                trial[k] = coefficients[k] + 0.3 * (trial[k] - coefficients[k])
            for j in range(n):
                at[j] = positions[j] + 0.3 * (at[j] - positions[j])
            continue
        best = value
        coefficients[:] = trial
        positions[:] = at
        if not cholesky(precision):
            break
        gain = solve_factor(precision, step)
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
                move = (terms[j, 0] - terms[j, 2] * short * moves[j]) / terms[j, 1]
                at[j] = min(max(at[j] + min(max(move, -0.5), 0.5), bounds[0]), bounds[1])
    return best


@compiled
def best_under_flux_error(
    out: Array,
    centres: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    basis: Array,
    grid: Pair,
) -> None:
    """Fill the joint maximum over coefficients and ranges of every parameter vector.

    Parameters
    ----------
    out : ndarray, shape (n, frames, 3)
        Filled with log r, the frame's share of the joint log density, and the standard deviation of
        log r; nan, log likelihood and nan for a frame without object.
    centres : ndarray, shape (n, functions)
        Filled with the coefficients.
    shapes, crosstalks, backgrounds, laws, frames, present, r0, wave, read, shot, relative
        As from `CollapsedDensity.arguments`.
    basis, grid
        As for `inference.density.discrepancy_integral.integrate_flux_error`.
    """
    strongest = frames[:, 2].max()
    n = frames.shape[0]
    knots = np.empty((basis.shape[0], 2))
    delta = (knots, grid[0], grid[1])
    positions = np.empty(n)
    for i in range(shapes.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        bounds = integration_bounds(law)
        centre = centres[i]
        centre[:] = 0.0
        out[i, :, 0], out[i, :, 1], out[i, :, 2] = math.nan, -math.inf, math.nan
        if not bounds[1] > bounds[0] or not math.isfinite(law[0]):
            continue
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, delta)
        fill_curve(knots, basis, centre)
        best_positions(positions, frames, present, bounds, strongest, scene)
        climb_jointly(centre, positions, frames, bounds, basis, scene)
        fill_curve(knots, basis, centre)
        prior = 0.0
        for k in range(centre.size):
            prior -= 0.5 * centre[k] * centre[k]
        for j in range(n):
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            if present is not None and not present[j]:
                out[i, j, 1] = prior / n + empty_frame_log_likelihood(
                    frame, crosstalk, background, r0, wave, read, shot
                )
                continue
            if not math.isfinite(positions[j]):
                continue
            u = _follow(positions[j], frame, bounds, scene)
            bend = slope_and_curvature(u, frame, *scene)[1]
            out[i, j, 0] = u
            out[i, j, 1] = prior / n + log_integrand(u, frame, *scene) + log_top(read)
            out[i, j, 2] = 1.0 / math.sqrt(bend) if bend > 0.0 else math.inf
