"""The log likelihood of every frame, its range integrated out."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.range_integral import integrate_range
from inference.density.table_integral import (
    has_sharp_mode,
    integrate_table,
    is_tabled,
    table_step,
    value_at_end,
)
from inference.frame.arguments import Instrument, Rows, scene_of
from inference.frame.blocks import Data, block_of, is_empty
from inference.frame.dark_mass import with_dark_mass
from inference.frame.gaussian import log_top
from inference.frame.log_density import empty_log_likelihood
from inference.frame.modes import find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.closed import closed
from simulator.compiled import compiled, hot

__all__ = ["fill_log_likelihoods"]

Array = NDArray[np.float64]


@hot
@closed
@compiled
def fill_log_likelihoods(out: Array, rows: Rows, data: Data, instrument: Instrument) -> None:
    """Fill out[i, b] with the log likelihood of block b under parameter vector i."""
    for i in range(out.shape[0]):
        scene = scene_of(rows, instrument, i)
        bounds = integration_bounds(scene.range_prior)
        if not bounds[1] > bounds[0]:
            out[i, :] = -math.inf
            continue
        table = tabulate(bounds, scene, data.strongest)
        scene = with_dark_mass(table, scene)
        values, shares = np.empty(table.shape[1]), np.empty(table.shape[1])
        modes = room_for_modes(table)
        step = table_step(table, data, instrument)
        for b in range(out.shape[1]):
            block = block_of(data, b)
            if is_empty(data, b):
                out[i, b] = empty_log_likelihood(block, scene)
                continue
            count = find_modes(modes, values, table, block, scene)
            if step > 0.0 and is_tabled(data, b) and not has_sharp_mode(modes, count, step):
                values[-1] = value_at_end(table, block, scene)
                mass = integrate_table(modes, count, values, shares, step)
                if not math.isnan(mass):
                    out[i, b] = mass + log_top(instrument.read)
                    continue
            out[i, b] = integrate_range(modes, count, block, scene)
