"""The flux error integrated out: Laplace in its coefficients, every range integrated adaptively.

For given parameters the log likelihood of all frames is a function of the coefficients alone, each
frame's range being integrated out exactly under the curve that they make, over all its modes. A
joint climb in coefficients and ranges, which costs little, comes near the maximum; Newton's method
on the integrals ends there. Where the maximum fits nothing, ranges are Laplace's as well.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.dark_slope import add_dark_slope
from inference.density.flux_expansion import FluxFunctions, add_mode, add_row, expand
from inference.density.joint_maximum import best_positions, climb_jointly, with_error
from inference.density.range_integral import integrate_range
from inference.density.triangular import solve_factor, update_factor
from inference.frame.arguments import (
    FrameScene,
    Instrument,
    RangePrior,
    Rows,
    scene_of,
)
from inference.frame.blocks import Data, block_of, is_empty
from inference.frame.dark_mass import with_dark_mass
from inference.frame.flux_error import fill_knots
from inference.frame.gaussian import LOG_2PI, log_top
from inference.frame.log_density import empty_log_likelihood
from inference.frame.modes import LOG_MASS, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.assign import assign
from simulator.closed import closed
from simulator.compiled import compiled

__all__ = ["integrate_flux_error"]

Array = NDArray[np.float64]

_ROUNDS = 8
_SMALL = 1e-2  # nats that may be left to be gained where a step gains nothing
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
    data: Data,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Integrate every frame under given coefficients; the log density of both.

    Filled are the frames' log likelihoods, the gradient, and the factor of the precision.
    """
    fill_knots(functions.error.knots, functions.basis, coefficients)
    table = tabulate(integration_bounds(scene.range_prior), scene, data.strongest)
    scene = with_dark_mass(table, scene)
    work = np.empty(table.shape[1])
    modes = room_for_modes(table)
    n, size = values.size, coefficients.size
    rows = np.empty((size, n))
    row = np.empty(size)
    count, total, darkness = 0, 0.0, 0.0
    factor[:] = 0.0
    for k in range(size):
        factor[k, k] = 1.0
        gradient[k] = -coefficients[k]
        total -= 0.5 * coefficients[k] * coefficients[k]
    for j in range(n):
        block = block_of(data, j)
        if is_empty(data, j):
            values[j] = empty_log_likelihood(block, scene)
            total += values[j]
            continue
        found = find_modes(modes, work, table, block, scene)
        values[j] = integrate_range(modes, found, block, scene)
        total += values[j]
        if not math.isfinite(values[j]):
            return -math.inf
        highest, mass = -math.inf, 0.0
        for m in range(found):
            highest = max(highest, modes[m, LOG_MASS])
        for m in range(found):
            mass += math.exp(modes[m, LOG_MASS] - highest)
        for m in range(found):
            weight = math.exp(modes[m, LOG_MASS] - highest) / mass
            if weight < _FEW:
                continue
            darkness += add_mode(gradient, row, weight, modes[m], block, scene, functions)
            for k in range(size):
                rows[k, count] = row[k]
            count += 1
            if count == n:
                update_factor(factor, rows, count)
                count = 0
    update_factor(factor, rows, count)
    add_dark_slope(gradient, darkness, table, data.strongest, scene, functions)
    return total


@compiled
def _newton(
    values: Array,
    coefficients: Array,
    factor: Array,
    data: Data,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Climb the integrated density; return its Laplace integral over the coefficients.

    `coefficients` and `factor` end as centre and precision's factor of the expansion.
    """
    size = coefficients.size
    step = np.empty(size)
    trial = coefficients.copy()
    trial_values, trial_factor = np.empty(values.size), np.empty((size, size))
    best, gain = -math.inf, 0.0
    part, last = 0.0, np.zeros(size)
    curve = np.empty((functions.basis.shape[0], 2))
    for _ in range(_ROUNDS):
        value = _round(trial_values, step, trial_factor, trial, data, scene, functions)
        if not value > best - 1e-9 * (1.0 + abs(best)):
            if best == -math.inf:
                return -math.inf
            # along a parabola that turns back so soon no more than this is left to be gained
            if 0.25 * part * part * gain < _SMALL:
                gain, last = 0.0, 0.0 * last
                break
            part *= 0.3
            last *= 0.3
            assign(trial, coefficients + last)
            continue
        best = value
        assign(values, trial_values)
        assign(coefficients, trial)
        assign(factor, trial_factor)
        gain = solve_factor(factor, step)
        fill_knots(curve, functions.basis, step)
        longest = np.abs(curve[:, 0]).max()
        if not math.isfinite(longest):
            return -math.inf
        part = min(1.0, _LONGEST / max(longest, _LONGEST))
        last = part * step
        if gain < _DONE or gain > _LOST:
            break
        assign(trial, coefficients + last)
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
    data: Data,
    scene: FrameScene,
    functions: FluxFunctions,
) -> float:
    """Return Laplace's integral over coefficients and ranges around their joint maximum.

    Filled are the frames' shares and the factor of the precision.
    """
    n, size = values.size, coefficients.size
    fill_knots(functions.error.knots, functions.basis, coefficients)
    rows = np.zeros((size, n))
    row = np.empty(size)
    total = 0.0
    factor[:] = 0.0
    for k in range(size):
        factor[k, k] = 1.0
        total -= 0.5 * coefficients[k] * coefficients[k]
    for j in range(n):
        block = block_of(data, j)
        if not math.isfinite(positions[j]):
            values[j] = empty_log_likelihood(block, scene) if is_empty(data, j) else -math.inf
            total += values[j]
            continue
        density, _, bend, _, _, stiff, free, _, _ = expand(positions[j], block, scene)
        # where nothing bends the range does not follow, and its prior is as wide as it can be
        values[j] = density + log_top(scene.instrument.read)
        if bend > 0.0:
            values[j] += 0.5 * (LOG_2PI - math.log(bend))
        total += values[j]
        row[:] = 0.0
        add_row(row, functions, positions[j], math.sqrt(free if bend > 0.0 else stiff))
        for k in range(size):
            rows[k, j] = row[k]
    update_factor(factor, rows, n)
    for k in range(size):
        total -= math.log(abs(factor[k, k]))
    return total


@compiled
def _without_reference(scene: FrameScene) -> FrameScene:
    """Return a scene whose ranges have no reference prior.

    A maximum over ranges knows none, which is a density for integrals.
    """
    constant, power, mean, inverse_sd, log_mean, log_inverse_sd, low, high, _, _ = scene.range_prior
    return FrameScene(
        scene.shape,
        scene.crosstalk,
        scene.background,
        RangePrior(
            constant, power, mean, inverse_sd, log_mean, log_inverse_sd, low, high, False, 1.0
        ),
        scene.instrument,
        scene.flux_error,
        scene.offset,
    )


@closed
@compiled
def integrate_flux_error(
    out: Array,
    centres: Array,
    factors: Array,
    rows: Rows,
    data: Data,
    instrument: Instrument,
    functions: FluxFunctions,
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
        slot = i if centres.shape[0] > 1 else 0
        centre, factor = centres[slot], factors[slot]
        centre[:] = 0.0
        out[i, :] = -math.inf
        if not bounds[1] > bounds[0]:
            continue
        fill_knots(functions.error.knots, functions.basis, centre)
        flat = _without_reference(scene)
        best_positions(positions, data, flat)
        best = climb_jointly(centre, positions, data, flat, functions)
        if best < -_HOPELESS * n:
            total = _laplace(out[i], centre, factor, positions, data, scene, functions)
        else:
            total = _newton(out[i], centre, factor, data, scene, functions)
        if not math.isfinite(total):
            out[i, :] = -math.inf
            continue
        parts = 0.0
        for j in range(n):
            parts += out[i, j]
        share = (total - parts) / n
        for j in range(n):
            out[i, j] += share
