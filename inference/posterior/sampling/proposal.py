"""What independent jumps propose from: Student-t laws on the optima, and a map that unbends."""

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.sampling.importance import Law, WeightedDraws
from inference.posterior.sampling.start import Optimum
from inference.posterior.sampling.transport import TriangularMap

__all__ = [
    "Local",
    "Mixture",
    "Proposal",
    "completed",
    "log_student",
    "mixture_of",
    "student",
]

Array = NDArray[np.float64]

_LAPLACE_SHARE = 0.15  # of a proposal with a map that stays with the optima
_MORE_SHARE = 0.2  # of a proposal with more laws, that is theirs
_MOST_MORE = 4  # of them
_LONG = 10.0  # jumps until one is taken, above which a place gets a law
_MAP_DEGREES = 6.0  # of freedom in a map's coordinates, where the posterior is nearly normal
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
        constant = scipy.special.gammaln((_DEGREES + d) / 2) - scipy.special.gammaln(_DEGREES / 2)
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
        squares = np.einsum("mni,mni->mn", standard, standard)
        # of what lies beyond all numbers infinities may cancel
        return np.where(np.isnan(squares), np.inf, squares)

    def draw(self, random: np.random.Generator | np.random.RandomState, n: int) -> Array:
        """Draw n points, shape (n, d); emcee brings a RandomState."""
        d = self.centres.shape[1]
        component = random.choice(self.weights.size, size=n, p=self.weights)
        normal = random.standard_normal((n, d))
        scale = np.sqrt(_DEGREES / random.chisquare(_DEGREES, size=n))
        step = np.einsum("nij,nj->ni", self.factors[component], normal)
        return np.asarray(self.centres[component] + scale[:, None] * step)

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


def student(random: np.random.Generator | np.random.RandomState, n: int, d: int) -> Array:
    """Draw n points of a standard Student-t law in d dimensions, shape (n, d)."""
    normal = random.standard_normal((n, d))
    scale = np.sqrt(_MAP_DEGREES / random.chisquare(_MAP_DEGREES, size=n))
    return np.asarray(scale[:, None] * normal)


def log_student(x: Array) -> Array:
    """Return the log density of a standard Student-t law at x of shape (n, d), shape (n,)."""
    d = x.shape[1]
    constant = scipy.special.gammaln((_MAP_DEGREES + d) / 2)
    constant -= scipy.special.gammaln(_MAP_DEGREES / 2)
    constant -= 0.5 * d * math.log(_MAP_DEGREES * math.pi)
    tail = np.log1p(np.einsum("ni,ni->n", x, x) / _MAP_DEGREES)
    return np.asarray(constant - 0.5 * (_MAP_DEGREES + d) * tail)


@dataclasses.dataclass(frozen=True, eq=False)
class Local:
    """A Student-t law in the coordinates of a map."""

    transport: TriangularMap
    law: Mixture

    def log_density(self, z: Array) -> Array:
        """Return the log density at z of shape (n, d), shape (n,)."""
        x, log_det = self.transport.unbend(z)
        density, near = np.full(len(z), -np.inf), np.isfinite(x).all(axis=1)
        # what a map has beyond all numbers is far from every law in its coordinates
        density[near] = self.law.log_density(x[near]) + log_det[near]
        return density

    def draw(self, random: np.random.Generator | np.random.RandomState, n: int) -> Array:
        """Draw n points, shape (n, d)."""
        return self.transport.bend(self.law.draw(random, n))[0]


@dataclasses.dataclass(frozen=True, eq=False)
class Proposal:
    """The law of independent jumps.

    Attributes
    ----------
    optima : Mixture
        Laplace approximations at the optima.
    transport : TriangularMap or None
        Where the Laplace shapes do not fit: a Student-t law in its coordinates takes most of the
        weight, and ensembles walk in these coordinates.
    share : float
        Of the steps of an ensemble that propose from it.
    more : tuple of Law
        Laws of places of which the others hold too little.
    """

    optima: Mixture
    transport: TriangularMap | None
    share: float
    more: tuple[Law, ...] = ()

    def unbend(self, z: Array) -> tuple[Array, Array]:
        """Return the walkers' coordinates of z, and log |dx/dz|."""
        if self.transport is None:
            return z, np.zeros(len(z))
        return self.transport.unbend(z)

    def bend(self, x: Array) -> tuple[Array, Array]:
        """Return z of the walkers' coordinates, and log |dz/dx|."""
        if self.transport is None:
            return x, np.zeros(len(x))
        return self.transport.bend(x)

    def log_density(self, z: Array, laplace: Array | None = None) -> Array:
        """Return the log density at z of shape (n, d), shape (n,).

        `laplace` is that of ``optima`` there, where it is known from another proposal.
        """
        most = self._log_density_of_most(z, laplace)
        if not self.more:
            return most
        return _with_more(most, np.array([law.log_density(z) for law in self.more]))

    def _log_density_of_most(self, z: Array, laplace: Array | None) -> Array:
        laplace = self.optima.log_density(z) if laplace is None else laplace
        if self.transport is None:
            return laplace
        x, log_det = self.transport.unbend(z)
        mapped = math.log1p(-_LAPLACE_SHARE) + log_student(x) + log_det
        mapped = np.where(np.isnan(mapped), -np.inf, mapped)
        return np.asarray(np.logaddexp(math.log(_LAPLACE_SHARE) + laplace, mapped))

    def draw(self, random: np.random.Generator | np.random.RandomState, n: int) -> Array:
        """Draw n points z, shape (n, d); emcee brings a RandomState."""
        z = self._draw_of_most(random, n)
        if not self.more:
            return z
        own = random.uniform(size=n) < _MORE_SHARE
        which = np.where(own, (len(self.more) * random.uniform(size=n)).astype(int), -1)
        for k, law in enumerate(self.more):
            z[which == k] = law.draw(random, int(np.count_nonzero(which == k)))
        return z

    def _draw_of_most(self, random: np.random.Generator | np.random.RandomState, n: int) -> Array:
        z = self.optima.draw(random, n)
        if self.transport is None:
            return z
        mapped = self.transport.bend(student(random, *z.shape))[0]
        laplace = random.uniform(size=n) < _LAPLACE_SHARE
        return np.where(laplace[:, None], z, mapped)

    def propose(self, coords: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        """Propose walkers' coordinates independently of where they are, for emcee's `MHMove`."""
        new = self.draw(random, coords.shape[0])
        x, new_det = self.unbend(new)
        old, old_det = self.bend(coords)
        # densities in the walkers' coordinates: that of z times |dz/dx|
        return x, self.log_density(old) + old_det - self.log_density(new) + new_det


def completed(proposal: Proposal, laws: Sequence[Law], draws: WeightedDraws) -> Proposal:
    """Add laws to a proposal, of places where it holds too little.

    A walker leaves a place by a jump as seldom as the density there exceeds that of the proposal:
    a branch that a map does not follow is hardly ever entered, and then not left.

    Parameters
    ----------
    proposal : Proposal
        Of jumps.
    laws : sequence of Law
        To choose from: a map of an early round may hold what the last one left out.
    draws : WeightedDraws
        Of the posterior, from elsewhere.

    Returns
    -------
    Proposal
        With the laws that lower the largest excess at the draws most, until it is tenfold at most.
    """
    target, most = draws.log_density - draws.log_evidence, proposal.log_density(draws.z)
    each = np.array([law.log_density(draws.z) for law in laws])
    chosen: tuple[int, ...] = ()
    beyond = float(np.max(target - most))
    while len(chosen) < _MOST_MORE and beyond > math.log(_LONG):
        tried = {
            float(np.max(target - _with_more(most, each[[*chosen, k]]))): k
            for k in range(len(laws))
            if k not in chosen
        }
        if not tried or min(tried) >= beyond:
            break
        beyond = min(tried)
        chosen = (*chosen, tried[beyond])
    if not chosen:
        return proposal
    return dataclasses.replace(proposal, more=tuple(laws[k] for k in chosen))


def _with_more(most: Array, each: Array) -> Array:
    """Return log densities of a mixture, of those of its first part and of each other law."""
    share = math.log(_MORE_SHARE / len(each))
    return np.asarray(np.logaddexp.reduce([math.log1p(-_MORE_SHARE) + most, *(share + each)]))
