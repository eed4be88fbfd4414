"""All ranges that explain a frame, given everything else."""

import numpy as np
from numpy.typing import NDArray

from inference.density.curve_table import integration_bounds, tabulate
from inference.density.gaussian import Pair
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.fits.likelihood.problem import FitProblem
from simulator.compiled import compiled

__all__ = ["MOST", "frame_modes"]

Array = NDArray[np.float64]

MOST = 8  # modes of a frame that are kept, the best


@compiled
def _fill_modes(
    out: Array,
    shapes: Array,
    crosstalks: Array,
    backgrounds: Array | None,
    laws: Array,
    frames: Array,
    present: NDArray[np.bool_],
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill out[j, k] with log r and deviance of the modes of frame j, the best first."""
    strongest = frames[:, 2].max()
    shape = (shapes[0, 0], shapes[0, 1], shapes[0, 2])
    crosstalk = crosstalk_of(crosstalks, 0)
    background = background_of(backgrounds, 0)
    law = law_of(laws, 0)
    bounds = integration_bounds(law)
    out[:, :, 0], out[:, :, 1] = np.nan, np.inf
    if not bounds[1] > bounds[0]:
        return
    table = tabulate(bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest)
    values = np.empty(table.shape[1])
    modes = np.empty((values.size // 2 + 1, 6))
    scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
    for j in range(frames.shape[0]):
        if not present[j]:
            continue
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        count = find_modes(modes, values, table, frame, scene)
        for k in range(count):
            u, deviance = modes[k, 0], -2.0 * modes[k, 1]
            for place in range(MOST):
                if deviance < out[j, place, 1]:
                    for later in range(MOST - 1, place, -1):
                        out[j, later, 0] = out[j, later - 1, 0]
                        out[j, later, 1] = out[j, later - 1, 1]
                    out[j, place, 0], out[j, place, 1] = u, deviance
                    break


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
    values = problem.values(x)
    shapes, crosstalks, backgrounds, laws = problem.work()
    shapes[0] = problem.gain * values[0] * values[2], values[0], values[1]
    crosstalks[0] = values[3:5]
    if backgrounds is not None:
        backgrounds[0] = values[5:9]
        laws[0, 6] = max(laws[0, 6], -values[8])
    out = np.empty((problem.frames.shape[0], MOST, 2))
    _fill_modes(
        out,
        shapes,
        crosstalks,
        backgrounds,
        laws,
        problem.frames,
        problem.present,
        *problem.instrument,
    )
    return out[:, :, 0], out[:, :, 1]
