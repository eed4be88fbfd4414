"""The Object Parameter Model over arrays: the kernels of `object_model`, element by element."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simulator.compiled import compiled
from simulator.object_model import quadratic

__all__ = ["object_fluxes", "quadratics", "shadows"]

Array = NDArray[np.float64]


@compiled
def _quadratics(r: Array, c0: Array, c1: Array) -> Array:
    out = np.empty(r.size)
    for i in range(r.size):
        out[i] = quadratic(r[i], c0[i], c1[i])
    return out


def quadratics(r: ArrayLike, c0: ArrayLike, c1: ArrayLike) -> Array:
    """Return Q = r^2 + c1 r + c0 [m^2] without cancellation.

    Parameters
    ----------
    r : array_like
        Ranges [m], not negative.
    c0, c1 : array_like
        Object parameters [m^2], [m], of shapes that broadcast.

    Returns
    -------
    ndarray
        Of the common shape, to the last bit what `object_model.quadratic` gives.
    """
    parts = [np.asarray(part, dtype=np.float64) for part in (r, c0, c1)]
    shape = np.broadcast_shapes(*(part.shape for part in parts))
    flat = (np.broadcast_to(part, shape).flatten() for part in parts)
    return np.asarray(_quadratics(*flat).reshape(shape))


def object_fluxes(r: ArrayLike, strength: ArrayLike, c0: ArrayLike, c1: ArrayLike) -> Array:
    """Return strength / (r^2 Q), as `object_model.object_flux`."""
    at = np.asarray(r, dtype=np.float64)
    return np.asarray(strength, dtype=np.float64) / at / at / quadratics(at, c0, c1)


def shadows(r: ArrayLike, c0: ArrayLike, c1: ArrayLike) -> Array:
    """Return S = (r^2 + c1 r) / Q, as `background.shadow`."""
    at = np.asarray(r, dtype=np.float64)
    return at * (at + np.asarray(c1, dtype=np.float64)) / quadratics(at, c0, c1)
