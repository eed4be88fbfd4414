"""The flux error integrated out: Laplace in its coefficients, every range integrated adaptively.

For given parameters the log likelihood of all frames is a function of the coefficients alone, each
frame's range being integrated out exactly under the curve that they make, over all its modes. A
joint climb in coefficients and ranges, which costs little, comes near the maximum; Newton's method
on the integrals themselves ends there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.collapsed import empty_frame_log_likelihood
from inference.posterior.flux_error import add_mode, add_row, expand
from inference.posterior.frame_integral import (
    find_modes,
    frame_log_likelihood,
    integration_bounds,
    tabulate,
)
from inference.posterior.integrand import (
    Pair,
    Triple,
    WarpedArguments,
    log_integrand,
    log_top,
    slope_and_curvature,
)
from inference.posterior.rows import background_of, crosstalk_of, law_of
from inference.posterior.warp import fill_curve
from simulator.compiled import compiled

__all__ = ["best_under_flux_error", "integrate_flux_error"]

Array = NDArray[np.float64]

_CLIMBS = 15
_FOLLOWING = 4  # steps of a range after one of the curve
_NEAR = 1e-2  # nats that a climb may leave to Newton's method
_ROUNDS = 8
_DONE = 1e-3  # nats below the maximum at which the expansion is good
_LONGEST = 1.0  # of a step, in log flux
_FEW = 1e-5  # weight of a mode that is not looked at


@compiled
def update_factor(factor: Array, rows: Array, count: int) -> None:
    """Update an upper triangular R to that of R^T R + rows rows^T by Householder reflections.

    Parameters
    ----------
    factor : ndarray, shape (k, k)
        R, overwritten.
    rows : ndarray, shape (k, at least count)
        One column a row of the least squares problem; overwritten.
    count : int
        Columns in use.
    """
    size = factor.shape[0]
    for k in range(size):
        square = 0.0
        for i in range(count):
            square += rows[k, i] * rows[k, i]
        if square == 0.0:
            continue
        norm = math.sqrt(factor[k, k] * factor[k, k] + square)
        head = factor[k, k] + math.copysign(norm, factor[k, k])
        beta = 2.0 / (head * head + square)
        for j in range(k + 1, size):
            dot = head * factor[k, j]
            for i in range(count):
                dot += rows[k, i] * rows[j, i]
            dot *= beta
            factor[k, j] -= dot * head
            for i in range(count):
                rows[j, i] -= dot * rows[k, i]
        factor[k, k] = -math.copysign(norm, factor[k, k])


@compiled
def solve_factor(factor: Array, vector: Array) -> float:
    """Overwrite v by (R^T R)^-1 v; return half of v^T (R^T R)^-1 v."""
    size = vector.size
    half = 0.0
    for k in range(size):
        total = vector[k]
        for j in range(k):
            total -= factor[j, k] * vector[j]
        vector[k] = total / factor[k, k]
        half += 0.5 * vector[k] * vector[k]
    for k in range(size - 1, -1, -1):
        total = vector[k]
        for j in range(k + 1, size):
            total -= factor[k, j] * vector[j]
        vector[k] = total / factor[k, k]
    return half


@compiled
def _cholesky(matrix: Array) -> bool:
    """Overwrite the upper triangle by R with R^T R = matrix; False where rounding spoils it."""
    size = matrix.shape[0]
    for k in range(size):
        for i in range(k):
            for j in range(k, size):
                matrix[k, j] -= matrix[i, k] * matrix[i, j]
        if not matrix[k, k] > 0.0:
            return False
        root = math.sqrt(matrix[k, k])
        for j in range(k, size):
            matrix[k, j] /= root
    return True


@compiled
def _best_positions(
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
def _climb(
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
            density, along, bend, flux, mixed, stiff, free = expand(at[j], frame, *scene)
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
        if not _cholesky(precision):
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
def _round(
    values: Array,
    gradient: Array,
    factor: Array,
    coefficients: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    bounds: Pair,
    strongest: float,
    basis: Array,
    scene: WarpedArguments,
) -> float:
    """Integrate every frame under given coefficients; the log density of both.

    Filled are the frames' log likelihoods, the gradient, and the factor of the precision.
    """
    shape, crosstalk, background, law, r0, wave, read, shot, _, delta = scene
    fill_curve(delta[0], basis, coefficients)
    table = tabulate(
        bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest, delta
    )
    work = np.empty(table.shape[1])
    modes = np.empty((work.size // 2 + 1, 6))
    n, size = frames.shape[0], coefficients.size
    rows = np.empty((size, n))
    row = np.empty(size)
    count, total = 0, 0.0
    factor[:] = 0.0
    for k in range(size):
        factor[k, k] = 1.0
        gradient[k] = -coefficients[k]
        total -= 0.5 * coefficients[k] * coefficients[k]
    for j in range(n):
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        if present is not None and not present[j]:
            values[j] = empty_frame_log_likelihood(
                frame, crosstalk, background, r0, wave, read, shot
            )
            total += values[j]
            continue
        found = find_modes(modes, work, table, frame, scene)
        values[j] = frame_log_likelihood(modes, found, frame, scene)
        total += values[j]
        if not math.isfinite(values[j]):
            return -math.inf
        highest, mass = -math.inf, 0.0
        for m in range(found):
            highest = max(highest, modes[m, 5])
        for m in range(found):
            mass += math.exp(modes[m, 5] - highest)
        for m in range(found):
            weight = math.exp(modes[m, 5] - highest) / mass
            if weight < _FEW:
                continue
            add_mode(gradient, row, weight, modes[m], frame, scene, basis, delta)
            rows[:, count] = row
            count += 1
            if count == n:
                update_factor(factor, rows, count)
                count = 0
    update_factor(factor, rows, count)
    return total


@compiled
def _newton(
    values: Array,
    coefficients: Array,
    factor: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    bounds: Pair,
    strongest: float,
    basis: Array,
    scene: WarpedArguments,
) -> float:
    """Climb the integrated density; return its Laplace integral over the coefficients.

    `coefficients` and `factor` end as centre and precision's factor of the expansion.
    """
    size = coefficients.size
    step = np.empty(size)
    trial = coefficients.copy()
    trial_values, trial_factor = np.empty(values.size), np.empty((size, size))
    best, gain = -math.inf, 0.0
    last = np.zeros(size)
    curve = np.empty((basis.shape[0], 2))
    for _ in range(_ROUNDS):
        value = _round(
            trial_values,
            step,
            trial_factor,
            trial,
            frames,
            present,
            bounds,
            strongest,
            basis,
            scene,
        )
        if not value > best - 1e-9 * (1.0 + abs(best)):
            if best == -math.inf:
                return -math.inf
            if gain < _NEAR:  # the slope of wide modes is not exact
                break
            last *= 0.3
            trial[:] = coefficients + last
            continue
        best = value
        values[:] = trial_values
        coefficients[:] = trial
        factor[:] = trial_factor
        gain = solve_factor(factor, step)
        fill_curve(curve, basis, step)
        longest = np.abs(curve[:, 0]).max()
        if not math.isfinite(longest):
            return -math.inf
        last[:] = step * min(1.0, _LONGEST / max(longest, _LONGEST))
        if gain < _DONE:
            break
        trial[:] = coefficients + last
    coefficients += last
    total = best + min(gain, 1.0)
    for k in range(size):
        total -= math.log(abs(factor[k, k]))
    return total


@compiled
def integrate_flux_error(
    out: Array,
    centres: Array,
    factors: Array,
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
    """Fill out[i, j] with frame j's share of the log likelihood of parameter vector i.

    Parameters
    ----------
    out : ndarray, shape (n, frames)
        Filled; the sum over frames is the log likelihood, what the flux error adds to it being
        shared evenly.
    centres, factors : ndarray, shape (n, functions) and (n, functions, functions)
        Filled with the mean of the coefficients and the upper triangular factor of their precision;
        of length 1 where they are not wanted.
    shapes, crosstalks, backgrounds, laws, frames, present, r0, wave, read, shot, relative
        As from `CollapsedDensity.arguments`.
    basis : ndarray, shape (knots, 2, functions)
        Knots of the functions, multiplied by the standard deviation of the error.
    grid : (float, float)
        log r of the first knot, one over their spacing.
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
        slot = i if centres.shape[0] > 1 else 0
        centre, factor = centres[slot], factors[slot]
        centre[:] = 0.0
        out[i, :] = -math.inf
        if not bounds[1] > bounds[0] or not math.isfinite(law[0]):
            continue
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, delta)
        fill_curve(knots, basis, centre)
        _best_positions(positions, frames, present, bounds, strongest, scene)
        _climb(centre, positions, frames, bounds, basis, scene)
        total = _newton(out[i], centre, factor, frames, present, bounds, strongest, basis, scene)
        if not math.isfinite(total):
            out[i, :] = -math.inf
            continue
        share = (total - out[i].sum()) / n
        for j in range(n):
            out[i, j] += share


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
    shapes, crosstalks, backgrounds, laws, frames, present, r0, wave, read, shot, relative, basis, \
grid
        As for `integrate_flux_error`.
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
        _best_positions(positions, frames, present, bounds, strongest, scene)
        _climb(centre, positions, frames, bounds, basis, scene)
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
