"""Whitened readings of many frames with every frame's range eliminated."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.known_range import free_of_range
from inference.identifiability.information import Information

__all__ = ["eliminate", "moving"]

Array = NDArray[np.float64]

# standard deviations of noise by which a factor of e in range moves a reading, below which it moves
# none: the variance of that range would be no number
_LEAST = 1e-150


def moving(along_range: Array) -> NDArray[np.bool_]:
    """Return which frames' readings depend on their range, shape (n,), of derivatives (n, 2)."""
    with np.errstate(invalid="ignore"):  # nan of a frame without object compares as still
        return np.asarray(_length(along_range) > _LEAST)


def _length(vectors: Array) -> Array:
    """Return what `numpy.linalg.norm` does along the second axis, in less time."""
    return np.asarray(np.sqrt(np.square(vectors).sum(axis=1)))


def eliminate(
    names: tuple[str, ...],
    jacobian: Array,
    along_range: Array,
    errors: Array | None = None,
    *,
    common_range: bool = False,
    beside: tuple[Array, Array] | None = None,
) -> Information:
    """Eliminate the range of every frame.

    Parameters
    ----------
    names : tuple of str
        The unknowns.
    jacobian : ndarray, shape (n, 2, d)
        Whitened derivatives of the readings.
    along_range : ndarray, shape (n, 2)
        Whitened derivative along log r; zero where the readings do not depend on it, nan for a
        frame without object.
    errors : ndarray, shape (n, 2, k), optional
        Whitened derivatives along independent standard normal errors that all frames share.
    common_range : bool
        Whether all frames with an object have one range.
    beside : (ndarray, ndarray), shapes (n, 2) and (n, 2, d or d + k), optional
        Derivatives of what is known of range and displacement beside the readings, in units of its
        noise, along log r and along the unknowns, and the shared errors; 0 where nothing is.
    """
    n, _, d = jacobian.shape
    errors = np.empty((n, 2, 0)) if errors is None else errors
    k = errors.shape[-1]
    both = np.concatenate([jacobian, errors], axis=2)
    empty = np.asarray(np.isnan(along_range).any(axis=1))
    along = np.where(empty[:, None], 0.0, along_range)
    length = _length(along)
    moves, sizes = length > _LEAST, _length(jacobian)
    if common_range and moves.any():
        direction = along / np.linalg.norm(along)
        shift = np.einsum("ni,nid->d", direction, both)
        rows = (both - direction[:, :, None] * shift)[moves]
        rows = rows.reshape(2 * len(rows), d + k)  # nothing may be unknown
        # the difference of two vectors: rounding is that of the larger, over all frames
        largest = np.linalg.norm(sizes[moves], axis=0) / np.sqrt(2 * moves.sum())
        before = np.maximum(np.repeat(sizes[moves], 2, axis=0), largest)
        response = np.tile(-shift / np.linalg.norm(along), (n, 1))
        variance = np.full(n, 1 / np.square(length).sum())
    else:
        size = np.where(moves, length, 1.0)
        unit = along / size[:, None]
        # both components of the projection are one number along the normal: no difference is left
        # of two vectors, only that of two products
        normal = np.empty_like(unit)
        normal[:, 0], normal[:, 1] = -unit[:, 1], unit[:, 0]
        rows, before = np.einsum("ni,nid->nd", normal, both), sizes
        response = -np.einsum("ni,nid->nd", unit, both) / size[:, None]
        variance = 1 / size**2
        if not moves.all():
            rows, before = rows[moves], before[moves]
            response[~moves], variance[~moves] = 0.0, np.inf
    if not moves.all():
        whole = both[~moves]
        rows = np.concatenate([rows, whole.reshape(2 * len(whole), d + k)])
        before = np.concatenate([before, np.repeat(sizes[~moves], 2, axis=0)])
    if beside is not None:
        more, response, variance = _with_beside(both, along, beside, common_range)
        rows = np.concatenate([rows, more])
        size = np.repeat(np.hypot(sizes, np.linalg.norm(beside[1][:, :, :d], axis=1)), 2, axis=0)
        if common_range:  # the last row is of all frames
            size = np.concatenate([size, np.linalg.norm(size, axis=0)[None]])
        before = np.concatenate([before, size])
    response[empty], variance[empty] = np.nan, np.nan
    return Information(
        names,
        rows[:, :d],
        before,
        response[:, :d],
        variance,
        rows[:, d:],
        response[:, d:],
        common_range,
    )


def _with_beside(
    both: Array, along: Array, beside: tuple[Array, Array], common_range: bool
) -> tuple[Array, Array, Array]:
    """Return rows of what readings and knowledge beside them tell together, response, variance."""
    n, _, unknowns = both.shape
    other = np.zeros_like(both)
    other[:, :, : beside[1].shape[2]] = beside[1]
    told = beside[0]
    if common_range:  # one range: all that is known of it is known once, of one long frame
        length, size = float(np.linalg.norm(along)), float(np.linalg.norm(told))
        share = np.einsum("ni,nid->d", along, both) / max(length, 1e-300)
        # a displacement moves with its offset too: only what no offset makes tells the range
        direction = told / max(size, 1e-300)
        said = np.einsum("ni,nid->d", direction, other)
        whole = max(math.hypot(length, size), 1e-300)
        across = (other - direction[:, :, None] * said).reshape(2 * n, unknowns)
        last = size / whole * share - length / whole * said
        moved = -(share * (length / whole) + said * (size / whole)) / whole
        variance = np.full(n, 1.0 / whole**2 if length + size > 0 else math.inf)
        return np.vstack([across, last]), np.tile(moved, (n, 1)), variance
    rows = free_of_range(along, told, both, other)
    whole = np.square(along).sum(axis=1) + np.square(told).sum(axis=1)
    moved = np.einsum("ni,nid->nd", along, both) + np.einsum("ni,nid->nd", told, other)
    response = -np.divide(moved, whole[:, None], where=whole[:, None] > 0, out=0.0 * moved)
    variance = np.divide(1.0, whole, where=whole > 0, out=np.full(n, math.inf))
    return rows.reshape(2 * n, unknowns), np.array(response), variance
