"""Draws of a range from its density given everything else."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.range_integral import falls_off, integrate_range
from inference.frame.arguments import FrameScene, Instrument, Rows, scene_of
from inference.frame.blocks import Block, Data, block_of, is_empty
from inference.frame.dark_mass import with_dark_mass
from inference.frame.log_density import empty_log_likelihood, log_density
from inference.frame.modes import (
    LEFT,
    LOG_MASS,
    POSITION,
    RIGHT,
    SD,
    TOP,
    UNFINISHED,
    find_modes,
    room_for_modes,
)
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.closed import closed
from simulator.compiled import compiled

__all__ = ["fill_range_draws"]

Array = NDArray[np.float64]

_SIDE = 40  # grid points on either side of a mode
_FAR = 8.5  # standard deviations at which the grid ends where nothing is left
_TOLD = 1e-3  # nats by which a polynomial may miss the log density; a cell of the grid misses more
_PLACES = np.sinh(np.arcsinh(_FAR) * np.arange(-_SIDE, _SIDE + 1) / _SIDE)  # of it, in those
_AT, _DENSITY = 0, 1  # columns of a grid
_WHICH, _WHERE = 0, 1  # uniforms: for the mode, and for the place within it


@compiled
def _excess(x: float, mode: Array, block: Block, scene: FrameScene) -> float:
    """Return the log density x standard deviations off the top, less that of a normal one."""
    value = log_density(mode[POSITION] + x * mode[SD], block, scene)
    return float(value - mode[TOP] + 0.5 * x * x)


@compiled
def _fill_near_normal(grid: Array, mode: Array, block: Block, scene: FrameScene) -> bool:
    """Fill the grid of a mode whose log density is a polynomial of degree four; tell whether it is.

    Four evaluations fix it, four say whether it holds.
    """
    low4, low2 = _excess(-4.0, mode, block, scene), _excess(-2.0, mode, block, scene)
    high2, high4 = _excess(2.0, mode, block, scene), _excess(4.0, mode, block, scene)
    odd2, odd4 = 0.5 * (high2 - low2), 0.5 * (high4 - low4)
    even2, even4 = 0.5 * (high2 + low2), 0.5 * (high4 + low4)
    first, third = (8.0 * odd2 - odd4) / 12.0, (odd4 - 2.0 * odd2) / 48.0
    second, fourth = (16.0 * even2 - even4) / 48.0, (even4 - 4.0 * even2) / 192.0
    for x in (-3.0, -1.0, 1.0, 3.0):
        told = x * (first + x * (second + x * (third + x * fourth)))
        if not abs(told - _excess(x, mode, block, scene)) <= _TOLD:
            return False
    for k in range(_PLACES.size):
        x = _PLACES[k]
        told = x * (first + x * (second + x * (third + x * fourth)))
        u = mode[POSITION] + x * mode[SD]
        grid[k, _AT] = min(max(u, mode[LEFT]), mode[RIGHT])
        grid[k, _DENSITY] = math.exp(min(told - 0.5 * x * x, 50.0))
    return True


@compiled
def _fill_grid(grid: Array, mode: Array, block: Block, scene: FrameScene) -> None:
    """Fill a grid graded away from a mode's top, and the density on it."""
    reach = math.inf
    if mode[SD] < 1.0 and falls_off(mode, block, scene):
        if _fill_near_normal(grid, mode, block, scene):
            return
        reach = _FAR * mode[SD]
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        length = mode[POSITION] - mode[LEFT] if side == 0 else mode[RIGHT] - mode[POSITION]
        length = min(length, reach)
        scale = min(mode[SD], length)
        growth = math.asinh(length / scale) if scale > 0.0 else 0.0
        for j in range(_SIDE + 1):
            u = mode[POSITION] + sign * scale * math.sinh(growth * j / _SIDE)
            k = _SIDE + (j if side == 1 else -j)
            grid[k, _AT] = min(max(u, mode[LEFT]), mode[RIGHT])
            excess = log_density(grid[k, _AT], block, scene) - mode[TOP]
            grid[k, _DENSITY] = math.exp(min(excess, 50.0))


@compiled
def _invert(mode: Array, probability: float, grid: Array) -> float:
    """Invert the cumulative density of a mode's interval."""
    total = 0.0
    for k in range(1, 2 * _SIDE + 1):
        width = grid[k, _AT] - grid[k - 1, _AT]
        total += 0.5 * width * (grid[k, _DENSITY] + grid[k - 1, _DENSITY])
    if not total > 0.0:
        return float(mode[POSITION])
    wanted = probability * total
    for k in range(1, 2 * _SIDE + 1):
        width = grid[k, _AT] - grid[k - 1, _AT]
        left, right = grid[k - 1, _DENSITY], grid[k, _DENSITY]
        mass = 0.5 * width * (left + right)
        if wanted <= mass or k == 2 * _SIDE:
            # density linear in the cell: the root of a quadratic, in its stable form
            wanted = min(wanted, mass)
            if not mass > 0.0:
                return float(grid[k - 1, _AT])
            slope = (right - left) / width
            root = math.sqrt(max(left * left + 2.0 * slope * wanted, 0.0))
            return float(grid[k - 1, _AT] + 2.0 * wanted / (left + root))
        wanted -= mass
    return float(mode[POSITION])


@compiled
def _draw(
    modes: Array, count: int, uniforms: Array, block: Block, scene: FrameScene, grid: Array
) -> float:
    """Draw log r of a block from its modes; nan where there is none."""
    best, total = -math.inf, 0.0
    for k in range(count):
        best = max(best, modes[k, LOG_MASS])
    for k in range(count):
        total += math.exp(modes[k, LOG_MASS] - best)
    left = uniforms[_WHICH] * total
    for k in range(count):
        mass = math.exp(modes[k, LOG_MASS] - best)
        if left <= mass or k == count - 1:
            _fill_grid(grid, modes[k], block, scene)
            return _invert(modes[k], uniforms[_WHERE], grid)
        left -= mass
    return math.nan


@closed
@compiled
def fill_range_draws(
    out: Array,
    likelihoods: Array,
    unfinished: Array,
    uniforms: Array,
    rows: Rows,
    data: Data,
    instrument: Instrument,
) -> None:
    """Draw the range of every block of frames under every parameter vector.

    Parameters
    ----------
    out : ndarray, shape (n, blocks)
        Filled with log r; nan for frames without object.
    likelihoods : ndarray, shape (n, blocks)
        Filled with log p(block | vector), which the draw needs anyway.
    unfinished : ndarray, shape (n, blocks)
        Filled with how many panels of the integral over the range were taken as they are.
    uniforms : ndarray, shape (n, blocks, 2)
        Independent, on (0, 1).
    rows, data, instrument
        Parameters, frames and sensor.
    """
    grid = np.empty((2 * _SIDE + 1, 2))
    for i in range(out.shape[0]):
        scene = scene_of(rows, instrument, i)
        table = tabulate(integration_bounds(scene.range_prior), scene, data.strongest)
        scene = with_dark_mass(table, scene)
        values = np.empty(table.shape[1])
        modes = room_for_modes(table)
        for b in range(out.shape[1]):
            out[i, b], unfinished[i, b] = math.nan, 0.0
            block = block_of(data, b)
            if is_empty(data, b):
                likelihoods[i, b] = empty_log_likelihood(block, scene)
                continue
            count = find_modes(modes, values, table, block, scene)
            likelihoods[i, b] = integrate_range(modes, count, block, scene)
            for k in range(count):
                unfinished[i, b] += modes[k, UNFINISHED]
            out[i, b] = _draw(modes, count, uniforms[i, b], block, scene, grid)
