"""The likelihood with every range at its best value, linearised: for starting points."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.whitened import whitened
from inference.frame.arguments import prior_of

__all__ = ["Linearisation", "linearise"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Linearisation:
    """Whitened residuals of all frames at their best ranges, linear in z.

    Attributes
    ----------
    residual : ndarray, shape (frames, m)
        Whitened, the direction along the range projected out, times the root of what a frame stands
        for; m = 2 or, with what is known beside the readings, 4. With a discrepancy more rows,
        those of its coefficients, and their directions projected out, too.
    jacobian : ndarray, shape (frames, m, d)
        Derivative of the residual along z, projected likewise.
    """

    residual: Array
    jacobian: Array


def linearise(
    density: CollapsedDensity, z: Array, positions: Array, errors: Array | None = None
) -> Linearisation:
    """Linearise the readings in z, ranges eliminated (variable projection).

    Parameters
    ----------
    z : ndarray, shape (d,)
        Where.
    positions : ndarray, shape (frames,)
        log r of every frame; nan for a frame without object.
    errors : ndarray, shape (frames, 2, k), optional
        Whitened derivatives of the readings along more errors, independent and standard normal,
        which give way as the ranges do; left out: none.
    """
    basis = density.flux_basis(z, positions)
    error = None
    if basis is not None:
        error = (basis.values @ basis.coefficients, basis.slopes @ basis.coefficients)
    at = whitened(density.sensor, density.parameters, density.frames, z, positions, error)
    # a frame at the edge of its prior, or without object, has no range to give way
    prior = prior_of(density.parameters.terms(z[None]).ranges[0])
    low, high = prior.low, prior.high
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = (np.exp(positions) > low * (1 + 1e-9)) & (np.exp(positions) < high * (1 - 1e-9))
    ranges = density.range_of_frame
    seen, along, by_z = at.rows
    direction = np.where(inside[:, None], along, 0.0)
    length = np.sqrt(_sums(ranges, np.sum(direction * direction, axis=1)))[:, None]
    unit = np.divide(direction, length, out=np.zeros_like(direction), where=length > 0)

    def across(vectors: Array) -> Array:
        """Project the directions of the ranges out of vectors of shape (frames, m, k)."""
        shares = _sums(ranges, np.einsum("ni,nid->nd", unit, vectors))
        return np.asarray(vectors - unit[:, :, None] * shares[:, None, :])

    residual, jacobian = across(seen[:, :, None])[:, :, 0], across(-by_z)
    size = np.ones((len(seen), 1, 1))
    if density.weights is not None:
        size = np.sqrt(density.weights)[:, None, None]
        residual, jacobian = residual * size[:, 0], jacobian * size
    other, known = [], []
    if basis is not None:
        signal = np.zeros_like(seen)
        signal[:, :2] = at.signal
        other.append(size * across(-signal[:, :, None]) * basis.values[:, None, :])
        known.append(basis.coefficients)
    if errors is not None:
        moved = np.zeros((*seen.shape, errors.shape[2]))
        moved[:, :2] = errors
        other.append(size * across(-moved))
        known.append(np.zeros(errors.shape[2]))
    if not known:
        return Linearisation(residual, jacobian)
    return _eliminate(residual, jacobian, np.concatenate(other, axis=2), np.concatenate(known))


def _sums(ranges: NDArray[np.intp], values: Array) -> Array:
    """Return for every frame the sum of values over the frames that have the same range."""
    total = np.zeros((ranges.max() + 1, *values.shape[1:]))
    np.add.at(total, ranges, values)
    return total[ranges]


def _eliminate(
    residual: Array, jacobian: Array, other: Array, coefficients: Array
) -> Linearisation:
    """Project out coefficients with standard normal priors, which add residuals of their own.

    Parameters
    ----------
    residual, jacobian : ndarray, shape (frames, m) and (frames, m, d)
        Of what stays.
    other : ndarray, shape (frames, m, k)
        Derivative of the residual along the coefficients.
    coefficients : ndarray, shape (k,)
        What they are.

    Returns
    -------
    Linearisation
        With the rows of the coefficients behind.
    """
    (m, d), k = jacobian.shape[1:], coefficients.size
    q = np.linalg.qr(np.concatenate([other.reshape(-1, k), np.eye(k)]))[0]
    pad = -k % m
    rows = np.concatenate([residual.ravel(), coefficients])
    rows = rows - q @ (q.T @ rows)
    matrix = np.concatenate([jacobian.reshape(-1, d), np.zeros((k, d))])
    matrix = matrix - q @ (q.T @ matrix)
    return Linearisation(
        np.concatenate([rows, np.zeros(pad)]).reshape(-1, m),
        np.concatenate([matrix, np.zeros((pad, d))]).reshape(-1, m, d),
    )
