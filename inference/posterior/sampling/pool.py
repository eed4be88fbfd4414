"""Draws of many laws at once, each weighted by the mixture of all of them.

What one law leaves out another holds (Owen and Zhou 2000): a draw counts by the target over the
mixture, whichever law it came from.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.importance import Law
from inference.posterior.sampling.proposal import Proposal

__all__ = ["Blend", "Pool", "joined", "mixed", "more_of_all", "with_laws"]

Array = NDArray[np.float64]


class Blend(NamedTuple):
    """A mixture of laws.

    Attributes
    ----------
    laws : tuple of Law
        What it is made of.
    counts : tuple of int
        Draws of each, to which their shares are in proportion.
    """

    laws: tuple[Law, ...]
    counts: tuple[int, ...]

    def log_density(self, z: Array) -> Array:
        """Return the log density at z of shape (n, d), shape (n,)."""
        return mixed(np.array([law.log_density(z) for law in self.laws]), self.counts)

    def draw(self, rng: np.random.Generator | np.random.RandomState, n: int) -> Array:
        """Draw n points, shape (n, d): from each law its share, rounded."""
        parts = zip(self.laws, self.dealt(n), strict=True)
        return np.concatenate([law.draw(rng, count) for law, count in parts if count])

    def dealt(self, n: int) -> tuple[int, ...]:
        """Return how many of n draws come from each law."""
        ends = np.cumsum((0, *self.counts)) * n // sum(self.counts)
        return tuple(np.diff(ends).tolist())


class Pool(NamedTuple):
    """Draws of all rounds, and the law of them all.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Draws; members of the populations come first.
    target : ndarray, shape (n,)
        Their log density.
    laws : tuple of Law
        What they were drawn from, the members apart.
    counts : tuple of int
        How many from each.
    each : ndarray, shape (laws, n)
        Log density of every law.
    laplace : ndarray, shape (n,)
        Log density of the optima's mixture, which all maps have a part of.
    """

    z: Array
    target: Array
    laws: tuple[Law, ...]
    counts: tuple[int, ...]
    each: Array
    laplace: Array

    @property
    def blend(self) -> Blend:
        """The law of them all."""
        return Blend(self.laws, self.counts)

    @property
    def log_ratios(self) -> Array:
        """Log of the target over that law, shape (n,)."""
        return np.asarray(self.target - mixed(self.each, self.counts))


def with_laws(
    pool: Pool,
    laws: tuple[Law, ...],
    counts: tuple[int, ...],
    density: CollapsedDensity,
    rng: np.random.Generator,
) -> Pool:
    """Return a pool with draws from more laws.

    Parameters
    ----------
    laws : tuple of Law
        The new ones, of which at least one is a proposal with the optima of all others.
    counts : tuple of int
        Draws of each.
    """
    new = np.concatenate([law.draw(rng, n) for law, n in zip(laws, counts, strict=True)])
    there = _laplace(laws, new)
    z, laplace = np.concatenate([pool.z, new]), np.concatenate([pool.laplace, there])
    laws = pool.laws + laws
    old = [_log_density(law, new, there) for law in pool.laws]
    each = np.concatenate([pool.each, np.reshape(old, (len(old), len(new)))], axis=1)
    more = [_log_density(law, z, laplace) for law in laws[len(pool.laws) :]]
    target = np.concatenate([pool.target, density(new)])
    return Pool(z, target, laws, pool.counts + counts, np.concatenate([each, more]), laplace)


def _laplace(laws: Sequence[Law], z: Array) -> Array:
    """Return the log density of the mixture that all proposals among the laws have a part of."""
    one = next(law for law in laws if isinstance(law, Proposal))
    return one.optima.log_density(z)


def _log_density(law: Law, z: Array, laplace: Array) -> Array:
    """Return the log density of a law, given that of the mixture."""
    return law.log_density(z, laplace) if isinstance(law, Proposal) else law.log_density(z)


def more_of_all(pool: Pool, density: CollapsedDensity, rng: np.random.Generator, n: int) -> Pool:
    """Return n draws from all laws of a pool in their shares, as a pool of their own."""
    z, counts = pool.blend.draw(rng, n), pool.blend.dealt(n)
    laplace = _laplace(pool.laws, z)
    each = np.array([_log_density(law, z, laplace) for law in pool.laws])
    return Pool(z, density(z), pool.laws, counts, each, laplace)


def joined(pool: Pool, more: Pool) -> Pool:
    """Return the draws of two pools of the same laws."""
    return Pool(
        np.concatenate([pool.z, more.z]),
        np.concatenate([pool.target, more.target]),
        pool.laws,
        tuple(a + b for a, b in zip(pool.counts, more.counts, strict=True)),
        np.concatenate([pool.each, more.each], axis=1),
        np.concatenate([pool.laplace, more.laplace]),
    )


def mixed(each: Array, counts: tuple[int, ...]) -> Array:
    """Return the log density of a mixture, its laws in proportion to counts.

    Parameters
    ----------
    each : ndarray, shape (laws, n)
        Log density of every law.

    Returns
    -------
    ndarray, shape (n,)
    """
    shares = np.log(np.array(counts) / sum(counts))
    return np.asarray(special.logsumexp(each + shares[:, None], axis=0))
