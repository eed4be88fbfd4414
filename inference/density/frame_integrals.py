"""The log likelihood of every frame, its range integrated out."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.range_integral import integrate_range
from inference.frame.arguments import Instrument, Rows, scene_of
from inference.frame.blocks import Data, block_of, is_empty
from inference.frame.dark_mass import with_dark_mass
from inference.frame.log_density import empty_log_likelihood
from inference.frame.modes import find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.compiled import compiled, hot

__all__ = ["fill_log_likelihoods"]

Array = NDArray[np.float64]


@hot
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
        values = np.empty(table.shape[1])
        modes = room_for_modes(table)
        for b in range(out.shape[1]):
            block = block_of(data, b)
            if is_empty(data, b):
                out[i, b] = empty_log_likelihood(block, scene)
                continue
            count = find_modes(modes, values, table, block, scene)
            out[i, b] = integrate_range(modes, count, block, scene)
