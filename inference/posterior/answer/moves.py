"""Draws moved by errors, each as the draw nearest to it moves."""

import dataclasses
import functools

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Moves"]

Array = NDArray[np.float64]

_AT_ONCE = 20_000  # draws that are moved
# what linear response is taken for at most: e-folds of a range, and standard deviations of a prior
_FARTHEST_RANGE, _FARTHEST = 1.0, 3.0


@dataclasses.dataclass(frozen=True, eq=False)
class Moves:
    """How draws move with errors.

    Attributes
    ----------
    z : ndarray, shape (m, d)
        Draws at which the response was computed.
    log_r : ndarray, shape (m, frames)
        Their ranges; nan for a frame without object.
    by_z : ndarray, shape (m, d, 1 + k)
        Change of z, and with each of k independent standard normal errors.
    by_log_r : ndarray, shape (m, frames, 1 + k)
        Change of log r likewise.
    """

    z: Array
    log_r: Array
    by_z: Array
    by_log_r: Array

    @functools.cached_property
    def _tree(self) -> "tuple[scipy.spatial.KDTree, Array]":
        sd = self.z.std(axis=0)
        unit = np.where(sd > 0, sd, 1.0)
        return scipy.spatial.KDTree(self.z / unit), unit

    def errors(self, count: int, rng: np.random.Generator) -> Array:
        """Draw errors for draws, shape (count, 1 + k): the first is a constant one."""
        errors = rng.standard_normal((count, self.by_z.shape[2]))
        errors[:, 0] = 1.0
        return errors

    def moved(self, z: Array, errors: Array) -> Array:
        """Move parameters, shape (n, d), each by the response of the draw nearest to it."""
        if z.shape[1] == 0:
            return z
        result = np.empty_like(z)
        tree, unit = self._tree
        for start in range(0, len(z), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            near = tree.query(z[part] / unit)[1]
            shift = np.einsum("ndk,nk->nd", self.by_z[near], errors[part])
            result[part] = z[part] + _bounded(shift, _FARTHEST)
        return result

    def moved_ranges(self, log_r: Array, errors: Array, ends: Array) -> Array:
        """Move ranges by the same errors, inside the ends of their prior.

        Parameters
        ----------
        log_r : ndarray, shape (n, frames)
            Draws; nan for a frame without object.
        errors : ndarray, shape (n, 1 + k)
            Of each draw.
        ends : ndarray, shape (n, 2)
            Lowest and highest log r of the prior at each draw.

        Returns
        -------
        ndarray, shape (n, frames)
            Each range follows the response at the nearest of its own draws: of its own mode.
        """
        result = log_r.copy()
        for j in np.flatnonzero(np.isfinite(log_r).all(axis=0)):
            order = np.argsort(self.log_r[:, j])
            places = self.log_r[order, j]
            right = np.clip(np.searchsorted(places, log_r[:, j]), 1, max(len(places) - 1, 1))
            right = np.minimum(right, len(places) - 1)
            left = np.maximum(right - 1, 0)
            nearer = log_r[:, j] - places[left] < places[right] - log_r[:, j]
            near = order[np.where(nearer, left, right)]
            shift = np.einsum("nk,nk->n", self.by_log_r[near, j], errors)
            result[:, j] += _bounded(shift, _FARTHEST_RANGE)
        return np.clip(result, ends[:, :1], ends[:, 1:])


def _bounded(shift: Array, limit: float) -> Array:
    return np.asarray(limit * np.tanh(shift / limit))
