"""A mixture of Student-t laws on the optima: importance sampling, and an emcee move."""

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, spatial, special

from inference.posterior.start import Optimum

__all__ = ["Mixture", "adapted", "mixture_of"]

Array = NDArray[np.float64]

_COMPONENTS = 96  # local pieces of an adapted mixture
_LAPLACE_SHARE = 0.15  # of an adapted mixture that stays with the optima

_DEGREES = 5.0  # of freedom: heavier tails than any posterior that the Laplace shape fits


@dataclasses.dataclass(frozen=True, eq=False)
class Mixture:
    """A mixture of multivariate Student-t laws.

    Attributes
    ----------
    centres : ndarray, shape (m, d)
        Centres.
    factors : ndarray, shape (m, d, d)
        Lower triangular scale factors.
    weights : ndarray, shape (m,)
        Sum to one.
    share : float
        Of the steps of an ensemble that propose from it.
    """

    centres: Array
    factors: Array
    weights: Array
    share: float = 0.5

    def log_density(self, z: Array) -> Array:
        """Return the log density at z of shape (n, d), shape (n,)."""
        d = self.centres.shape[1]
        constant = special.gammaln((_DEGREES + d) / 2) - special.gammaln(_DEGREES / 2)
        constant -= 0.5 * d * math.log(_DEGREES * math.pi)
        logdet = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        tail = -0.5 * (_DEGREES + d) * np.log1p(self._squares(z) / _DEGREES)
        parts = constant + tail + (np.log(self.weights) - logdet)[:, None]
        return np.asarray(np.logaddexp.reduce(parts, axis=0))

    @functools.cached_property
    def _inverses(self) -> Array:
        return np.asarray(np.linalg.inv(self.factors), dtype=np.float64)

    def _squares(self, z: Array) -> Array:
        """Return squared Mahalanobis distances, shape (m, n)."""
        # einsum, not BLAS: its threads cost more than these few numbers
        standard = np.einsum("mij,mnj->mni", self._inverses, z - self.centres[:, None])
        return np.asarray(np.einsum("mni,mni->mn", standard, standard))

    def draw(self, random: np.random.Generator | np.random.RandomState, n: int) -> Array:
        """Draw n points, shape (n, d); emcee brings a RandomState."""
        d = self.centres.shape[1]
        component = random.choice(self.weights.size, size=n, p=self.weights)
        normal = random.standard_normal((n, d))
        scale = np.sqrt(_DEGREES / random.chisquare(_DEGREES, size=n))
        step = np.einsum("nij,nj->ni", self.factors[component], normal)
        return np.asarray(self.centres[component] + scale[:, None] * step)

    def propose(self, coords: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Propose independently of where the walkers are, for `emcee.moves.MHMove`."""
        new = self.draw(random, coords.shape[0])
        return new, self.log_density(coords) - self.log_density(new)

    def nearest(self, z: Array) -> NDArray[np.intp]:
        """Return the component that each z of shape (n, d) belongs to most."""
        nearest: NDArray[np.intp] = np.argmin(self._squares(z), axis=0)
        return nearest


def mixture_of(optima: Sequence[Optimum]) -> Mixture:
    """Make the mixture of the Laplace approximations at all optima.

    Parameters
    ----------
    optima : sequence of Optimum
        At least one.

    Returns
    -------
    Mixture
        Weights in proportion to the Laplace masses, none below 2 %, so that an optimum which
        Laplace underrates is still visited.
    """
    masses = np.array([optimum.log_mass for optimum in optima])
    weights = np.maximum(np.exp(masses - masses.max()), 0.02)
    return Mixture(
        np.array([optimum.z for optimum in optima]),
        np.array([optimum.factor for optimum in optima]),
        weights / weights.sum(),
    )


def adapted(optima: Mixture, draws: Array, rng: np.random.Generator) -> Mixture:
    """Make a mixture that follows a curved posterior: a local piece at each of many draws.

    Parameters
    ----------
    optima : Mixture
        Laplace approximations, which keep a share.
    draws : ndarray, shape (n, d)
        Pilot draws of all ensembles together, none of which may be kept as a result.
    rng : numpy.random.Generator
        Chooses the draws that become centres.

    Returns
    -------
    Mixture
        Each piece has the covariance of the draws nearest to its centre.
    """
    n, d = draws.shape
    spread = linalg.cholesky(np.cov(draws.T).reshape(d, d) + 1e-12 * np.eye(d), lower=True)
    white = linalg.solve_triangular(spread, draws.T, lower=True).T
    chosen = rng.choice(n, size=min(_COMPONENTS, n), replace=False)
    near = spatial.cKDTree(white).query(white[chosen], k=min(10 * d + 10, n))[1]
    factors = []
    for neighbours in np.atleast_2d(near):
        local = np.cov(white[neighbours].T).reshape(d, d)
        # nearest neighbours have less spread than the piece of the law that they stand for
        local = local + 0.02 * np.trace(local) / d * np.eye(d)
        factors.append(spread @ linalg.cholesky(local, lower=True))
    pieces = np.full(chosen.size, (1 - _LAPLACE_SHARE) / chosen.size)
    return Mixture(
        np.concatenate([optima.centres, draws[chosen]]),
        np.concatenate([optima.factors, np.array(factors)]),
        np.concatenate([_LAPLACE_SHARE * optima.weights, pieces]),
    )
