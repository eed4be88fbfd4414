"""All ranges that explain a frame, given everything else."""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import Fit
from inference.fits.likelihood.deviance import open_values
from inference.fits.likelihood.problem import FitProblem
from inference.frame.arguments import scene_of
from inference.frame.blocks import block_of, is_empty
from inference.frame.modes import POSITION, TOP, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import tabulate
from simulator.assign import assign
from simulator.compiled import compiled

__all__ = ["MOST", "frame_modes"]

Array = NDArray[np.float64]

DEVIANCE = 1  # in a frame's modes, beside `POSITION`
MOST = 8  # modes of a frame that are kept, the best


@compiled
def _keep(out: Array, position: float, deviance: float) -> None:
    """Put a mode into its place among the best of a frame."""
    for place in range(MOST):
        if deviance < out[place, DEVIANCE]:
            for later in range(MOST - 1, place, -1):
                assign(out[later], out[later - 1])
            out[place, POSITION], out[place, DEVIANCE] = position, deviance
            break


@compiled
def _fill_modes(out: Array, values: Array, fit: Fit) -> None:
    """Fill out[j, k] with log r and deviance of the modes of frame j, the best first."""
    open_values(values, fit)
    data = fit.data
    scene = scene_of(fit.rows, fit.instrument, 0)
    bounds = integration_bounds(scene.range_prior)
    out[:, :, POSITION], out[:, :, DEVIANCE] = np.nan, np.inf
    if not bounds[1] > bounds[0]:
        return
    table = tabulate(bounds, scene, data.strongest)
    knots = np.empty(table.shape[1])
    modes = room_for_modes(table)
    for j in range(out.shape[0]):
        if is_empty(data, j):
            continue
        for k in range(find_modes(modes, knots, table, block_of(data, j), scene)):
            _keep(out[j], modes[k, POSITION], -2.0 * modes[k, TOP])


def frame_modes(problem: FitProblem, x: Array) -> tuple[Array, Array]:
    """Find the modes of every frame.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Coordinates.

    Returns
    -------
    (ndarray, ndarray), each of shape (n, MOST)
        log r, nan-padded, and deviance (-2 log likelihood relative to no residual under read
        noise alone), inf-padded, the best first.
    """
    out = np.empty((problem.frames.shape[0], MOST, 2))
    _fill_modes(out, problem.values(x), problem.kernel_fit())
    return out[:, :, POSITION], out[:, :, DEVIANCE]
