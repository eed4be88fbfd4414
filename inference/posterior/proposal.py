"""A mixture of Student-t laws on the optima: importance sampling, and an emcee move."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from inference.posterior.start import Optimum

__all__ = ["Mixture", "mixture_of"]

Array = NDArray[np.float64]

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
    """

    centres: Array
    factors: Array
    weights: Array

    def log_density(self, z: Array) -> Array:
        """Return the log density at z of shape (n, d), shape (n,)."""
        d = self.centres.shape[1]
        constant = special.gammaln((_DEGREES + d) / 2) - special.gammaln(_DEGREES / 2)
        constant -= 0.5 * d * math.log(_DEGREES * math.pi)
        parts = []
        for centre, factor, weight in zip(self.centres, self.factors, self.weights, strict=True):
            standard = linalg.solve_triangular(factor, (z - centre).T, lower=True)
            square = np.einsum("ij,ij->j", standard, standard)
            logdet = np.log(np.diagonal(factor)).sum()
            tail = -0.5 * (_DEGREES + d) * np.log1p(square / _DEGREES)
            parts.append(math.log(weight) + constant - logdet + tail)
        return np.asarray(special.logsumexp(parts, axis=0))

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
        distance = []
        for centre, factor in zip(self.centres, self.factors, strict=True):
            standard = linalg.solve_triangular(factor, (z - centre).T, lower=True)
            distance.append(np.einsum("ij,ij->j", standard, standard))
        return np.argmin(distance, axis=0)


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
