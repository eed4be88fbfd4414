"""All ranges that explain a frame, given everything else."""

import numpy as np
from numpy.typing import NDArray

from inference.density.curve_table import integration_bounds, tabulate
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.fits.likelihood.arguments import Fit
from inference.fits.likelihood.deviance import POSITION, open_values
from inference.fits.likelihood.problem import FitProblem
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
                out[later] = out[later - 1]
            out[place, POSITION], out[place, DEVIANCE] = position, deviance
            break


@compiled
def _fill_modes(out: Array, values: Array, present: NDArray[np.bool_], fit: Fit) -> None:
    """Fill out[j, k] with log r and deviance of the modes of frame j, the best first."""
    open_values(values, fit)
    rows, data = fit.rows, fit.data
    r0, wave, read, shot, relative = fit.instrument
    strongest = data.frames[:, 2].max()
    shape = (rows.shapes[0, 0], rows.shapes[0, 1], rows.shapes[0, 2])
    crosstalk = crosstalk_of(rows.crosstalks, 0)
    background = background_of(rows.backgrounds, 0)
    law = law_of(rows.range_priors, 0)
    bounds = integration_bounds(law)
    out[:, :, POSITION], out[:, :, DEVIANCE] = np.nan, np.inf
    if not bounds[1] > bounds[0]:
        return
    table = tabulate(bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest)
    knots = np.empty(table.shape[1])
    modes = np.empty((knots.size // 2 + 1, 6))
    scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
    for j in range(data.frames.shape[0]):
        if not present[j]:
            continue
        frame = (data.frames[j, 0], data.frames[j, 1], data.frames[j, 2])
        for k in range(find_modes(modes, knots, table, frame, scene)):
            _keep(out[j], modes[k, 0], -2.0 * modes[k, 1])


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
    _fill_modes(out, problem.values(x), problem.present, problem.kernel_fit())
    return out[:, :, POSITION], out[:, :, DEVIANCE]
