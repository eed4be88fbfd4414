"""Moments of a density in up to three dimensions, on a lattice that knows nothing of a sampler.

The trapezoidal rule converges faster than any power of its spacing for a smooth density that dies
out inside the box (Trefethen and Weideman 2014): at a spacing of one standard deviation a normal
law's moments are right to 1e-7. Two lattices, one at the centres of the other's cells, tell how far
that holds here.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_DIMENSIONS", "Moments", "lattice_moments"]

Array = NDArray[np.float64]

MOST_DIMENSIONS = 3
_SPACINGS = (1.0, 0.5, 0.25, 0.125)  # in standard deviations
_MARGIN = 1.5  # standard deviations around what the box must hold
_MOST_AT_EDGE = 1e-4  # share of the mass on a face of the box
_EXTENSIONS = 4
_MOST_ERROR = 0.02  # of first and second moments, in standard deviations


@dataclasses.dataclass(frozen=True, eq=False)
class Moments:
    """First and second moments with their errors.

    Attributes
    ----------
    first, second : ndarray, shape (d,)
        Means of every coordinate and of its square.
    first_error, second_error : ndarray, shape (d,)
        Their errors.
    """

    first: Array
    second: Array
    first_error: Array
    second_error: Array


def lattice_moments(
    log_density: Callable[[Array], Array], low: Array, high: Array, most: int
) -> Moments | None:
    """Integrate first and second moments over a box that grows until it holds the mass.

    Parameters
    ----------
    log_density : callable
        (n, d) -> (n,), in coordinates of about unit spread.
    low, high : ndarray, shape (d,)
        Where the mass is thought to be; the box is larger.
    most : int
        Evaluations that may be spent.

    Returns
    -------
    Moments or None
        None where the moments were not found within the effort allowed.
    """
    low, high = low - _MARGIN, high + _MARGIN
    spacings = iter(_SPACINGS)
    spacing = next(spacings)
    extensions = 0
    while True:
        counts = np.ceil((high - low) / spacing).astype(int) + 1
        most -= 2 * int(np.prod(counts))
        if most < 0:
            return None
        axes = [low[j] + spacing * np.arange(counts[j]) for j in range(low.size)]
        lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, low.size)
        values = log_density(np.concatenate([lattice, lattice + 0.5 * spacing])).reshape(2, -1)
        if not np.isfinite(values.max()):
            return None
        mass = np.exp(values - values.max())
        edges = _edge_mass(mass.sum(axis=0).reshape(counts)) / mass.sum()
        if edges.max() > _MOST_AT_EDGE and extensions < _EXTENSIONS:
            reach = np.where(edges > _MOST_AT_EDGE, 0.25 * (high - low), 0.0)
            low, high, extensions = low - reach[0], high + reach[1], extensions + 1
            continue
        weights = mass / np.maximum(mass.sum(axis=1), 1e-300)[:, None]
        points = np.array([lattice, lattice + 0.5 * spacing])
        first = np.einsum("sn,snd->sd", weights, points)
        second = np.einsum("sn,snd->sd", weights, points**2)
        errors = 0.5 * np.abs(np.diff(first, axis=0)[0]), 0.5 * np.abs(np.diff(second, axis=0)[0])
        share = mass[0].sum() / mass.sum() - 0.5  # the two lattices' integrals must agree as well
        if max(errors[0].max(), errors[1].max(), abs(share)) < _MOST_ERROR:
            if edges.max() > 10 * _MOST_AT_EDGE:
                return None
            return Moments(first.mean(axis=0), second.mean(axis=0), *errors)
        finer = next(spacings, None)
        if finer is None:
            return None
        spacing = finer


def _edge_mass(mass: Array) -> Array:
    """Mass on the lower and upper face of every axis, shape (2, d)."""
    sides = [[np.take(mass, i, axis=j).sum() for j in range(mass.ndim)] for i in (0, -1)]
    return np.array(sides)
