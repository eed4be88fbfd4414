"""What errors of light are worth at a range that would send more of it than came.

Sizes, reflectances and errors of the flux are factors of the light. Linear about a range that would
send a hundred times what came, an error by half of it leaves that light two standard deviations
off, where its logarithm is nine off (docs/model.md, lacking-light).
"""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.model_error import errors_of_light
from inference.fits.likelihood.pairs import solved
from inference.fits.likelihood.problem import FitProblem
from inference.frame.noise import covariances
from inference.frame.sensitivity import Value

__all__ = ["moved_by_light", "share_of_light"]

Array = NDArray[np.float64]

_OF_LIGHT = (Value.C0, Value.C1, Value.C2)
_NOISE = 3.0  # standard deviations of a reading by which the light that came may be more
_LEAST = 1e-300  # of the light: its logarithm is a number


def share_of_light(problem: FitProblem, x: Array, u: Array) -> Array:
    """Return what linear errors of the light are worth of themselves, shape (n,), at most 1.

    Parameters
    ----------
    problem : FitProblem
        With readings less what errors of the model do to them.
    x, u : ndarray, shape (d,), (n,)
        Coordinates, and log r.

    Returns
    -------
    ndarray
        The share of a range's light that did not come, noise allowed for, over the logarithm by
        which it lacks.
    """
    by_value, along = np.empty((u.size, 2, SLOTS)), np.empty((u.size, 2))
    residual, values, at = np.empty_like(along), problem.opened(x)[0], problem.instrument
    fit = problem.kernel_fit()
    whitened_slopes(by_value, along, residual, values, np.eye(SLOTS), np.ascontiguousarray(u), fit)
    # crosstalk moves the readings themselves
    parts = [by_value[:, :, Value.C2, None] * values[Value.C2], residual[:, :, None]]
    whitener = by_value[:, :, list(CROSSTALK)]
    light, off = np.moveaxis(solved(whitener, np.concatenate(parts, axis=2)), 2, 0)
    readings = problem.frames[:, :2]
    noise = covariances(at, readings, readings)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        size = np.linalg.norm(light, axis=1)
        way = light / size[:, None]
        doubt = np.sqrt(np.einsum("ni,nij,nj->n", way, noise, way))
        came = 1.0 + ((off * way).sum(axis=1) + _NOISE * doubt) / size
        came = np.clip(came, _LEAST, None)
        return np.where(came < 1.0, (1.0 - came) / -np.log(came), 1.0)


def moved_by_light(problem: FitProblem) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which coordinates and which errors move the object's light, shape (d,), (k,)."""
    return np.isin(problem.slots, _OF_LIGHT), errors_of_light(problem)
