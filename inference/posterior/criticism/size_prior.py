"""What an answer owes to the default prior of the object's c0: draws weighted to one twice as wide.

Where a scene says nothing of the object, c0 is supposed to be 0.1 m^2 to a factor of exp(2). Large
glossy surfaces are mostly beyond: they mirror the emitter, and their light falls off as from an
object of several square metres. What the readings tell by themselves stays where it is.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.posterior.criticism.flattened import flattened
from simulator.scene import Scene

__all__ = ["WiderPrior", "wider_prior"]

Array = NDArray[np.float64]

_NAME = "object.c0"
_FACTOR = 2.0


@dataclasses.dataclass(frozen=True)
class WiderPrior:
    """How an answer would change with a prior twice as wide.

    Attributes
    ----------
    of_z : ndarray, shape (d, 2)
        By two independent standard normal errors: one of the mean, and one along which the draws
        spread further, as they do with the mean of log r.
    of_log_r : ndarray, shape (frames, 2)
        Of log r; zero for a frame without object.
    """

    of_z: Array
    of_log_r: Array


def wider_prior(scene: Scene, names: tuple[str, ...], z: Array, log_r: Array) -> WiderPrior | None:
    """Weight draws to a default prior of c0 that is twice as wide.

    Parameters
    ----------
    scene : Scene
        As sampled.
    names : tuple of str
        Of the unknowns.
    z : ndarray, shape (n, d)
        Draws of equal weight, in the coordinates whose prior is standard normal.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    WiderPrior or None
        None where c0 is known or its prior stated, or the scene says that its model is exact: it
        then means what it says.
    """
    error, present = scene.model_error, np.isfinite(log_r[0])
    learnt = scene.joint is not None and _NAME in scene.joint.unknowns
    stated = learnt or scene.object.c0 is not None or not (error.flux or error.range_m)
    if stated or _NAME not in names or not present.any():
        return None
    c0 = z[:, names.index(_NAME)]
    by = flattened(0.5 * c0**2 * (1.0 - 1.0 / _FACTOR**2))
    columns = np.concatenate([z, np.where(present, log_r, 0.0)], axis=1)
    scale = log_r[:, present].mean(axis=1)
    apart, variance = scale - scale.mean(), float(scale.var())
    moved = by.moved(columns)
    along = np.zeros_like(moved)
    if variance > 0:
        centred = (scale - by.weights @ scale) ** 2
        wider = max(by.further * (float(by.weights @ centred) - variance), 0.0)
        along = apart @ (columns - columns.mean(axis=0)) / len(z) * np.sqrt(wider) / variance
    both, d = np.stack([moved, along], axis=1), z.shape[1]
    return WiderPrior(both[:d], both[d:])
