"""The best range of every frame, for given parameters."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.range_integral import best_mode
from inference.frame.arguments import Instrument, Rows, scene_of
from inference.frame.blocks import Data, block_of, frame_count, is_empty
from inference.frame.gaussian import log_top
from inference.frame.log_density import empty_log_likelihood
from inference.frame.modes import POSITION, SD, TOP, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.compiled import compiled

__all__ = ["BEST_DENSITY", "BEST_LOG_RANGE", "BEST_SD", "fill_best_ranges"]

Array = NDArray[np.float64]

# what is found of a block: log r, log density, standard deviation in log r
BEST_LOG_RANGE, BEST_DENSITY, BEST_SD = 0, 1, 2


@compiled
def fill_best_ranges(out: Array, rows: Rows, data: Data, instrument: Instrument) -> None:
    """Find the best mode of every block of frames under every parameter vector.

    Parameters
    ----------
    out : ndarray, shape (n, blocks, 3)
        Filled with log r, log p(readings, log r | theta) and its standard deviation in log r; nan,
        log likelihood and nan for a block without object.
    rows, data, instrument
        Parameters, frames and sensor.
    """
    for i in range(out.shape[0]):
        scene = scene_of(rows, instrument, i)
        bounds = integration_bounds(scene.range_prior)
        out[i, :, BEST_LOG_RANGE], out[i, :, BEST_SD] = math.nan, math.nan
        out[i, :, BEST_DENSITY] = -math.inf
        if not bounds[1] > bounds[0]:
            continue
        table = tabulate(bounds, scene, data.strongest)
        values = np.empty(table.shape[1])
        modes = room_for_modes(table)
        for b in range(out.shape[1]):
            block = block_of(data, b)
            if is_empty(data, b):
                out[i, b, BEST_DENSITY] = empty_log_likelihood(block, scene)
                continue
            best = best_mode(modes, find_modes(modes, values, table, block, scene))
            if best < 0:
                continue
            out[i, b, BEST_LOG_RANGE], out[i, b, BEST_SD] = modes[best, POSITION], modes[best, SD]
            top = frame_count(block) * log_top(instrument.read)
            out[i, b, BEST_DENSITY] = modes[best, TOP] + top
