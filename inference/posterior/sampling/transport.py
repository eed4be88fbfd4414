"""A triangular map that unbends a posterior: its curved sheet becomes nearly a standard normal.

Along the principal axes of a sample, widest first, every coordinate is standardised by a mean and a
log scale that are polynomials of the coordinates before it (a Knothe-Rosenblatt rearrangement of a
fixed form: Parno and Marzouk 2018, Transport map accelerated Markov chain Monte Carlo). Both
directions are explicit, so that a poor fit costs speed, never correctness.
"""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.triangular import update_factor
from inference.posterior.sampling.coordinates import Coordinates
from inference.posterior.sampling.flux_coordinate import FluxCoordinate
from simulator.compiled import compiled

__all__ = ["TriangularMap", "fit_map", "straight_map", "unbent_map"]

Array = NDArray[np.float64]

_POINTS = 6  # of the sample for every term of a polynomial
_BEYOND = 1.5  # times the reach of the sample: held to it, moves never widen a sheet too short
_RIDGE = 1e-3  # times the root of the sample size: keeps terms apart that are nearly the same
_DOUBT = 3.0  # squared standard errors below which a term counts as noise
_MEAN_LOG_NORMAL = 0.635  # less the mean of log |x| of a standard normal


@compiled
def _polynomial(w: Array, k: int, coefficients: Array, cubic: int) -> float:
    """Return a polynomial of w[:k], cubic in the first ones; terms in the order of `_features`."""
    total = float(coefficients[0])
    n = 1
    for i in range(k):
        total += coefficients[n] * w[i]
        n += 1
    for i in range(k):
        for j in range(i, k):
            total += coefficients[n] * w[i] * w[j]
            n += 1
    m = min(k, cubic)
    for i in range(m):
        for j in range(i, m):
            for h in range(j, m):
                total += coefficients[n] * w[i] * w[j] * w[h]
                n += 1
    return total


@compiled
def _unbend(
    out: Array,
    log_det: Array,
    whitened: Array,
    bounds: Array,
    means: Array,
    scales: Array,
    cubic: int,
) -> None:
    """Fill out[i] with x of whitened[i], and add log |dx/dw|."""
    n, d = whitened.shape
    inside = np.empty(d)
    for i in range(n):
        for k in range(d):
            scale = _polynomial(inside, k, scales[k], 0)
            out[i, k] = (whitened[i, k] - _polynomial(inside, k, means[k], cubic)) * math.exp(
                -scale
            )
            log_det[i] -= scale
            inside[k] = min(max(whitened[i, k], bounds[0, k]), bounds[1, k])


@compiled
def _bend(
    whitened: Array,
    log_det: Array,
    x: Array,
    bounds: Array,
    means: Array,
    scales: Array,
    cubic: int,
) -> None:
    """Fill whitened[i] with w of x[i], and add log |dw/dx|."""
    n, d = x.shape
    inside = np.empty(d)
    for i in range(n):
        for k in range(d):
            scale = _polynomial(inside, k, scales[k], 0)
            whitened[i, k] = _polynomial(inside, k, means[k], cubic) + math.exp(scale) * x[i, k]
            log_det[i] += scale
            inside[k] = min(max(whitened[i, k], bounds[0, k]), bounds[1, k])


@dataclasses.dataclass(frozen=True, eq=False)
class TriangularMap:
    """A map between parameters z and coordinates x that are nearly standard normal.

    Attributes
    ----------
    centre : ndarray, shape (d,)
        Mean of the sample it was fitted to.
    axes : ndarray, shape (d, d)
        Principal axes times their standard deviations, as columns, widest first.
    bounds : ndarray, shape (2, d)
        Somewhat more than the reach of the sample along the axes: polynomials are not continued
        beyond.
    means : ndarray, shape (d, terms)
        Polynomial coefficients of each coordinate's mean; row k uses the first ones.
    scales : ndarray, shape (d, terms)
        Coefficients of each coordinate's log scale, at most quadratic.
    cubic : int
        Widest coordinates that have cubic terms in the means.
    coordinates : FluxCoordinate, LightAtRest, Reparametrisation or None
        Applied before all of this; None for z itself.
    """

    centre: Array
    axes: Array
    bounds: Array
    means: Array
    scales: Array
    cubic: int
    coordinates: Coordinates | None = None

    def moved(self, mean: Array, factor: Array) -> "TriangularMap":
        """Return the map of a normal law in the coordinates x of one that bends nothing.

        Parameters
        ----------
        mean, factor : ndarray, shape (d,) and (d, d)
            Of the law.
        """
        if self.means.any() or self.scales.any():
            raise ValueError("a map that bends")
        centre, axes = self.centre + self.axes @ mean, self.axes @ factor
        return unbent_map(centre, axes, self.coordinates)

    @property
    def _log_volume(self) -> float:
        return float(np.log(np.linalg.norm(self.axes, axis=0)).sum())

    def unbend(self, z: Array) -> tuple[Array, Array]:
        """Return x of shape (n, d) and log |dx/dz| of shape (n,)."""
        log_det = np.full(len(z), -self._log_volume)
        if self.coordinates is not None:
            z, log_volume = self.coordinates.with_volume(z)
            log_det += log_volume
        # the axes are orthogonal: their inverse is their transpose, rescaled
        inverse = self.axes / np.einsum("ij,ij->j", self.axes, self.axes)
        whitened = np.einsum("nj,jk->nk", z - self.centre, inverse)
        x = np.empty_like(whitened)
        _unbend(x, log_det, whitened, self.bounds, self.means, self.scales, self.cubic)
        return x, log_det

    def bend(self, x: Array) -> tuple[Array, Array]:
        """Return z of shape (n, d) and log |dz/dx| of shape (n,)."""
        whitened = np.empty_like(x)
        log_det = np.full(len(x), self._log_volume)
        _bend(
            whitened,
            log_det,
            np.ascontiguousarray(x),
            self.bounds,
            self.means,
            self.scales,
            self.cubic,
        )
        z = self.centre + np.einsum("nk,jk->nj", whitened, self.axes)
        if self.coordinates is not None:
            z = self.coordinates.backward(z)
            log_det -= self.coordinates.with_volume(z)[1]
        return z, log_det


def _features(w: Array, k: int, quadratic: bool, cubic: int) -> Array:
    """Return the terms of `_polynomial` at w, shape (n, terms)."""
    columns = [np.ones(len(w))]
    columns += [w[:, i] for i in range(k)]
    if quadratic:
        columns += [w[:, i] * w[:, j] for i in range(k) for j in range(i, k)]
    m = min(k, cubic)
    columns += [
        w[:, i] * w[:, j] * w[:, h] for i in range(m) for j in range(i, m) for h in range(j, m)
    ]
    return np.column_stack(columns)


def _regression(features: Array, target: Array, strength: float, times: Array) -> Array:
    """Least squares with scaled columns; terms that the sample does not show are left out.

    Rows count as often as ``times`` says, shape (n,).

    Terms, in their order and freed of those before them, are shrunk as the non-negative garrote
    does (Breiman 1995). Without it a map of eighty terms fits the noise of five hundred draws:
    members of a population that it did not see lie in its tails, where they stay, and directions
    that the readings leave open lost a third of their variance from the prior to the posterior.
    """
    k, n = features.shape[1], times.sum()
    scale = np.sqrt(times @ features**2 / n)
    scale = np.where(scale > 0, scale, 1.0)
    rows, root = np.empty((k + 1, len(times))), np.sqrt(times)
    rows[:k], rows[k] = (features / scale).T * root, target * root
    factor = math.sqrt(strength) * np.eye(k + 1)
    factor[0, 0] = factor[k, k] = 0.0
    # not LAPACK: the threads that it starts for so small a problem cost twice what they do
    update_factor(factor, rows, len(times))
    along = factor[1:k, k]
    copies = times @ times / n  # equal draws say as much as one of them
    noise = _DOUBT * copies * factor[k, k] ** 2 / max(n - k, 1)
    along *= np.maximum(0.0, 1.0 - noise / np.maximum(along**2, 1e-300))
    return np.asarray(scipy.linalg.solve_triangular(factor[:k, :k], factor[:k, k]) / scale)


def _signed(axes: Array) -> Array:
    """Return axes, as columns, with the largest component of each positive.

    What singular vectors come with differs from processor to processor, and draws would.
    """
    largest = np.argmax(np.abs(axes), axis=0)
    return axes * np.sign(np.take_along_axis(axes, largest[None], axis=0))


def _principal_axes(draws: Array, times: Array) -> tuple[Array, Array]:
    """Return the centre of a sample and its principal axes times their standard deviations."""
    centre = times @ draws / times.sum()
    # singular values, not eigenvalues of the covariance: thin sheets keep their digits
    apart = (draws - centre) * np.sqrt(times)[:, None]
    _, singular, rows = scipy.linalg.svd(apart, full_matrices=False)
    sd = singular / math.sqrt(times.sum())
    return centre, _signed(rows.T) * np.maximum(sd, 1e-12 * sd[0] + 1e-300)


def _sd(values: Array, times: Array) -> float:
    apart = values - times @ values / times.sum()
    return math.sqrt(float(times @ apart**2 / times.sum()))


def straight_map(draws: Array) -> TriangularMap:
    """Return the map that whitens a sample of shape (n, d), n > d, and bends nothing."""
    d = draws.shape[1]
    centre, axes = _principal_axes(draws, np.ones(len(draws)))
    nothing = np.zeros((d, math.comb(d + 1, 2)))
    return TriangularMap(centre, axes, np.zeros((2, d)), nothing, nothing, 0, None)


def unbent_map(centre: Array, factor: Array, coordinates: Coordinates | None) -> TriangularMap:
    """Return the map of a normal law in some coordinates to the standard one.

    Parameters
    ----------
    centre, factor : ndarray, shape (d,) and (d, d)
        Mean, and F with F F^T the covariance.
    coordinates : FluxCoordinate, LightAtRest, Reparametrisation or None
        Of both; None for z itself.
    """
    left, singular, _ = scipy.linalg.svd(factor)
    nothing = np.zeros((centre.size, math.comb(centre.size + 1, 2)))
    axes = _signed(left) * np.maximum(singular, 1e-12 * singular[0] + 1e-300)
    bounds = np.zeros((2, centre.size))
    return TriangularMap(centre, axes, bounds, nothing, nothing, 0, coordinates)


def fit_map(draws: Array, coordinates: Coordinates | None = None) -> TriangularMap:
    """Fit the map that makes a sample nearly standard normal.

    Parameters
    ----------
    draws : ndarray, shape (n, d)
        n > d, not all equal; duplicates count as often as they stand there.
    coordinates : FluxCoordinate, LightAtRest or Reparametrisation, optional
        That the map starts from; of a flux, at the range at which the sample tells it best.

    Returns
    -------
    TriangularMap
    """
    n, d = draws.shape
    if isinstance(coordinates, FluxCoordinate):
        coordinates = coordinates.fitted(draws)
    draws, often = np.unique(draws, axis=0, return_counts=True)
    times = often.astype(float)
    if coordinates is not None:
        draws = coordinates.forward(draws)
    centre, axes = _principal_axes(draws, times)
    whitened = (draws - centre) @ (axes / np.einsum("ij,ij->j", axes, axes))
    rest = n // _POINTS - math.comb(d + 1, 2)
    cubic = max((m for m in range(d) if math.comb(m + 2, 3) <= rest), default=0)
    quadratic = n // _POINTS >= 2 * math.comb(d + 1, 2)
    means = np.zeros((d, math.comb(d + 1, 2) + math.comb(cubic + 2, 3)))
    scales = np.zeros((d, math.comb(d + 1, 2)))
    strength = _RIDGE * math.sqrt(n)
    for k in range(d):
        features = _features(whitened, k, True, cubic)
        mean = _regression(features, whitened[:, k], strength, times) if k else np.zeros(1)
        residual = whitened[:, k] - features @ mean
        size = np.log(np.abs(residual) + 1e-3 * _sd(residual, times) + 1e-300) + _MEAN_LOG_NORMAL
        terms = _features(whitened, k, quadratic, 0)
        scale = _regression(terms, size, 3 * strength, times)
        scale[0] += math.log(max(_sd(residual * np.exp(-terms @ scale), times), 1e-300))
        means[k, : mean.size] = mean
        scales[k, : scale.size] = scale
    bounds = _BEYOND * np.array([whitened.min(axis=0), whitened.max(axis=0)])
    return TriangularMap(centre, axes, bounds, means, scales, cubic, coordinates)
