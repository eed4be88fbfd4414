"""Draws of many laws at once, each weighted by the mixture of all of them.

What one law leaves out another holds (Owen and Zhou 2000): a draw counts by the target over the
mixture, whichever law it came from.
"""

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.posterior.sampling.importance import Law, log_ratio
from inference.posterior.sampling.proposal import Proposal

__all__ = ["Pool", "drawn_by", "joined", "mixed", "shares_that_suit", "with_laws"]

Array = NDArray[np.float64]

_KEPT = 0.5  # of the shares that laws were drawn in: a law guards what few draws tell of
_DESCENT = 30


@dataclasses.dataclass(frozen=True, eq=False)
class Pool:
    """Draws of all rounds, and the law of them all.

    More draws, and more laws, append to every array of it: a store is given what is new.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Draws; members of the populations come first.
    target : ndarray, shape (m,)
        Log density of the first m; of the others it is still to be evaluated.
    laws : tuple of Law
        What they were drawn from, the members apart.
    counts : tuple of int
        How many from each.
    each : tuple of ndarray, shape (n,)
        Log density of every law.
    laplace : ndarray, shape (n,)
        Log density of the optima's mixture, which all maps have a part of.
    """

    z: Array
    target: Array
    laws: tuple[Law, ...]
    counts: tuple[int, ...]
    each: tuple[Array, ...]
    laplace: Array

    @property
    def open(self) -> Array:
        """Draws whose log density is still to be evaluated, shape (n - m, d)."""
        return self.z[len(self.target) :]

    def evaluated(self, values: Array) -> "Pool":
        """Return the pool with the log density of what was open."""
        return dataclasses.replace(self, target=np.concatenate([self.target, values]))

    @functools.cached_property
    def log_mixture(self) -> Array:
        """Log density of the law of them all, shape (n,)."""
        return mixed(self.each, self.counts)

    @functools.cached_property
    def log_ratios(self) -> Array:
        """Log of the target over that law, shape (n,)."""
        return log_ratio(self.target, self.log_mixture)


def with_laws(
    pool: Pool,
    laws: tuple[Law, ...],
    counts: tuple[int, ...],
    rng: np.random.Generator,
) -> Pool:
    """Return a pool with draws from more laws, which are open.

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
    more = tuple(_log_density(law, z, laplace) for law in laws[len(pool.laws) :])
    each = _appended(pool.each, old) + more
    return Pool(z, pool.target, laws, pool.counts + counts, each, laplace)


def _appended(each: Sequence[Array], more: Sequence[Array]) -> tuple[Array, ...]:
    return tuple(np.concatenate(two) for two in zip(each, more, strict=True))


def _laplace(laws: Sequence[Law], z: Array) -> Array:
    """Return the log density of the mixture that all proposals among the laws have a part of."""
    one = next(law for law in laws if isinstance(law, Proposal))
    return one.optima.log_density(z)


def _log_density(law: Law, z: Array, laplace: Array) -> Array:
    """Return the log density of a law, given that of the mixture."""
    return law.log_density(z, laplace) if isinstance(law, Proposal) else law.log_density(z)


def drawn_by(pool: Pool, shares: Array, n: int, rng: np.random.Generator) -> Pool:
    """Return n draws from all laws of a pool in these shares, as a pool of their own; all are open.

    A law gives its share of n, to within one draw, and in the mean its share exactly (systematic
    sampling, Madow 1949): draws that are made in parts are of the same mixture.
    """
    ends = np.floor(np.cumsum(shares) * n + rng.uniform()).astype(int)
    ends[-1] = n
    counts = tuple(np.diff(ends, prepend=0).tolist())
    parts = zip(pool.laws, counts, strict=True)
    z = np.concatenate([law.draw(rng, count) for law, count in parts if count])
    laplace = _laplace(pool.laws, z)
    each = tuple(_log_density(law, z, laplace) for law in pool.laws)
    return Pool(z, np.empty(0), pool.laws, counts, each, laplace)


def shares_that_suit(pool: Pool, members: int) -> tuple[Array, float]:
    """Return the shares of the laws at which draws of their mixture would count for most.

    Parameters
    ----------
    members : int
        The first of the pool's draws, which came from no law.

    Returns
    -------
    (ndarray, shape (laws,), float)
        They sum to one. Half of a law's share stays as it is. And the effective share of such
        draws.

    Notes
    -----
    The mean square of the weights is convex in the shares (He and Owen 2014, Optimal mixture
    weights in multiple importance sampling); each step multiplies a share by the root of its slope
    (power descent: Daudel, Douc and Portier 2021), which keeps it positive and lowers the mean.
    """
    given = np.array(pool.counts) / sum(pool.counts)
    log_weights = pool.log_ratios[members:]
    some = np.isfinite(log_weights)
    if not some.any():
        return given, 0.0
    log_weights, n = log_weights[some], len(log_weights)
    log_blend = pool.target[members:][some] - log_weights
    each = np.array([one[members:][some] for one in pool.each])
    ratios = np.exp(each - log_blend)  # at most one over a share
    weights = np.exp(log_weights - log_weights.max())
    moved = given
    for _ in range(_DESCENT):
        mixture = (_KEPT * given + (1.0 - _KEPT) * moved) @ ratios
        moved = moved * np.sqrt(ratios @ (weights / mixture) ** 2)
        moved = moved / moved.sum()
    shares = _KEPT * given + (1.0 - _KEPT) * moved
    mean_square = np.sum(weights**2 / (shares @ ratios)) / n
    return shares, float((np.sum(weights) / n) ** 2 / mean_square)


def joined(pool: Pool, more: Pool) -> Pool:
    """Return the draws of two pools of the same laws."""
    return Pool(
        np.concatenate([pool.z, more.z]),
        np.concatenate([pool.target, more.target]),
        pool.laws,
        tuple(a + b for a, b in zip(pool.counts, more.counts, strict=True)),
        _appended(pool.each, more.each),
        np.concatenate([pool.laplace, more.laplace]),
    )


def mixed(each: Sequence[Array] | Array, counts: Sequence[float] | Array) -> Array:
    """Return the log density of a mixture, its laws in proportion to counts.

    Parameters
    ----------
    each : sequence of ndarray, shape (n,)
        Log density of every law.

    Returns
    -------
    ndarray, shape (n,)
    """
    shares = np.log(np.array(counts) / np.sum(counts))
    return np.asarray(special.logsumexp(np.array(each) + shares[:, None], axis=0))
