"""The flux error integrated out: Laplace in its coefficients, every range integrated adaptively.

For given parameters the log likelihood of all frames is a function of the coefficients alone, each
frame's range being integrated out exactly under the curve that they make, over all its modes. A
joint climb in coefficients and ranges, which costs little, comes near the maximum; Newton's method
on the integrals ends there. Where the maximum fits nothing, ranges are Laplace's as well.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import empty_frame_log_likelihood
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.discrepancy_climb import best_positions, climb_jointly
from inference.density.flux_error import add_mode, add_row, expand
from inference.density.frame_integral import frame_log_likelihood
from inference.density.gaussian import LOG_2PI, Pair, log_top
from inference.density.integrand import WarpedArguments
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.density.triangular import solve_factor, update_factor
from inference.density.warp import fill_curve
from simulator.compiled import compiled

__all__ = ["integrate_flux_error"]

Array = NDArray[np.float64]

_ROUNDS = 8
_SMALL = 1e-2  # nats; the slope of wide modes is not exact
_DONE = 1e-3  # nats below the maximum at which the expansion is good
# nats that are still to be gained after the climb: parameters that fit nothing, where more would
# decide nothing; at optima of the coverage study it was seen to end within a nat
_LOST = 100.0
# nats a frame that the joint maximum is below a perfect fit, as for most parameters of a prior:
# their value only tells a population where to turn
_HOPELESS = 100.0
_LONGEST = 1.0  # of a step, in log flux
_FEW = 1e-5  # weight of a mode that is not looked at


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
            if gain < _SMALL:
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
        if gain < _DONE or gain > _LOST:
            break
        trial[:] = coefficients + last
    coefficients += last
    total = best + min(gain, 1.0)
    for k in range(size):
        total -= math.log(abs(factor[k, k]))
    return total


@compiled
def _laplace(
    values: Array,
    coefficients: Array,
    factor: Array,
    positions: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    basis: Array,
    scene: WarpedArguments,
) -> float:
    """Return Laplace's integral over coefficients and ranges around their joint maximum.

    Filled are the frames' shares and the factor of the precision.
    """
    _, crosstalk, background, _, r0, wave, read, shot, _, delta = scene
    n, size = frames.shape[0], coefficients.size
    fill_curve(delta[0], basis, coefficients)
    rows = np.zeros((size, n))
    row = np.empty(size)
    total = 0.0
    factor[:] = 0.0
    for k in range(size):
        factor[k, k] = 1.0
        total -= 0.5 * coefficients[k] * coefficients[k]
    for j in range(n):
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        if not math.isfinite(positions[j]):
            values[j] = -math.inf
            if present is not None and not present[j]:
                values[j] = empty_frame_log_likelihood(
                    frame, crosstalk, background, r0, wave, read, shot
                )
            total += values[j]
            continue
        density, _, bend, _, _, stiff, free, _ = expand(positions[j], frame, *scene)
        # where nothing bends the range does not follow, and its prior is as wide as it can be
        values[j] = density + log_top(read)
        if bend > 0.0:
            values[j] += 0.5 * (LOG_2PI - math.log(bend))
        total += values[j]
        row[:] = 0.0
        add_row(row, basis, positions[j], delta, math.sqrt(free if bend > 0.0 else stiff))
        rows[:, j] = row
    update_factor(factor, rows, n)
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
    laws: Array | tuple[Array],
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
        # a maximum over ranges knows no reference prior, which is a density for integrals
        flat = (shape, crosstalk, background, law[:8], r0, wave, read, shot, relative, delta)
        best_positions(positions, frames, present, bounds, strongest, flat)
        best = climb_jointly(centre, positions, frames, bounds, basis, flat)
        if best < -_HOPELESS * n:
            total = _laplace(out[i], centre, factor, positions, frames, present, basis, scene)
        else:
            total = _newton(
                out[i], centre, factor, frames, present, bounds, strongest, basis, scene
            )
        if not math.isfinite(total):
            out[i, :] = -math.inf
            continue
        share = (total - out[i].sum()) / n
        for j in range(n):
            out[i, j] += share
