"""The laws of the next round: maps fitted to the draws so far, and a law where these hold least.

One of two maps is fitted to draws that are weighted to a smaller power of the target: along a thin
ridge, where populations come slowly, it reaches beyond them. The law besides stands around the
place where the target exceeds the mixture most (incremental mixtures, Raftery and Bao 2010): no
polynomial follows a narrow second mode.
"""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import linalg, special

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.proposal import Local, Mixture, Proposal
from inference.posterior.sampling.shape import followed
from inference.posterior.sampling.transport import fit_map

__all__ = ["LAWS", "fitted", "next_laws", "next_shape"]

Array = NDArray[np.float64]

LAWS = 3  # of a round
_WIDE = (0.15, 0.5)  # powers of the target, by turns
_NEIGHBOURS = 10  # for every unknown, that a law around a place is fitted to; or
_NEAR = 0.05  # of all draws
_FITTED = 2000  # draws that a map is fitted to
_LEAST_ESS = 150.0  # of them, and
_ALONE = 1e-6  # of how far neighbours lie: a law so much narrower stands for one point
_PER_PAIR = 4.0  # times the square of the unknowns: weights are flattened until there are as many


def next_laws(
    density: CollapsedDensity,
    proposal: Proposal,
    pool: Pool,
    beyond: NDArray[np.bool_],
    rng: np.random.Generator,
) -> tuple[Proposal, Proposal, Local]:
    """Fit the laws of a round to the draws of those before.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    proposal : Proposal
        That of the round before.
    pool : Pool
        All draws so far.
    beyond : ndarray of bool, shape (m,)
        Which of the members, with which the pool begins, the draws leave out.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (Proposal, Proposal, Local)
        One that follows the target, a wider one, and a law around one place.
    """
    m = len(beyond)
    drawn, log_weights, members = pool.z[m:], pool.log_ratios[m:], pool.z[:m]
    sample = _sample(drawn, log_weights, members[beyond], m, rng)
    power = _WIDE[len(pool.laws) // LAWS % len(_WIDE)]
    flatter = _flatter(log_weights, pool.target[m:], power)
    wide = fitted(proposal, _sample(drawn, flatter, members[:0], 1, rng), density)
    proposal = fitted(proposal, sample, density)
    return proposal, wide, _around(proposal, pool.z, pool.log_ratios)


def next_shape(proposal: Proposal, pool: Pool, members: int) -> Proposal:
    """Return the proposal of a round whose shape follows the draws so far; members as of `Pool`."""
    if proposal.transport is None:
        raise ValueError("a proposal without a shape")
    return dataclasses.replace(proposal, transport=followed(proposal.transport, pool, members))


def fitted(proposal: Proposal, sample: Array, density: CollapsedDensity) -> Proposal:
    """Return a proposal with a map that is fitted to a sample of shape (n, d)."""
    return dataclasses.replace(proposal, transport=fit_map(sample, coordinates_of(density)))


def _flatter(log_weights: Array, target: Array, power: float) -> Array:
    """Return log weights to a power of the target, of draws with weights to itself."""
    at = np.where(np.isfinite(log_weights), target, 0.0)
    return np.asarray(log_weights + (power - 1.0) * at)


def _effective(log_weights: Array) -> float:
    """Return an effective sample size; 1 where the target is zero at every draw."""
    if not np.isfinite(log_weights).any():
        return 1.0
    weights: Array = special.softmax(log_weights)
    return 1.0 / float(np.sum(weights**2))


def _sample(
    z: Array, log_weights: Array, beyond: Array, members: int, rng: np.random.Generator
) -> Array:
    """Return what the next map is fitted to: draws by flattened weights, and members beyond them.

    Members are as many as stand for their share of the populations.
    """
    finite = np.isfinite(log_weights)
    z, log_weights = z[finite], log_weights[finite]
    least: float = min(max(_LEAST_ESS, _PER_PAIR * z.shape[1] ** 2), 0.5 * len(z))

    def surplus(power: float) -> float:
        return _effective(power * log_weights) - least

    power = 1.0 if surplus(1.0) >= 0 else float(scipy.optimize.brentq(surplus, 0.0, 1.0, xtol=1e-9))
    weights = special.softmax(power * log_weights)
    drawn = z[rng.choice(len(z), size=_FITTED, p=weights)]
    return np.concatenate([drawn, np.repeat(beyond, max(round(_FITTED / members), 1), axis=0)])


def _around(proposal: Proposal, z: Array, values: Array) -> Local:
    """Return a law around the point of the highest log weight, as wide as its neighbours lie."""
    transport = proposal.transport
    if transport is None:
        raise ValueError("a proposal without a map")
    finite = np.isfinite(values)
    x, values = transport.unbend(z[finite])[0], values[finite]
    # what a map has beyond all numbers has no neighbours in its coordinates
    near = np.isfinite(x).all(axis=1)
    x, values = x[near], values[near]
    d, centre = x.shape[1], x[np.argmax(values)]
    apart = x - centre
    count = max(_NEIGHBOURS * d, round(_NEAR * len(x)))
    nearest = np.argsort(np.einsum("ni,ni->n", apart, apart))[:count]
    rows = np.sqrt(special.softmax(values[nearest]))[:, None] * apart[nearest]
    scale, alone = _size(rows), _size(apart[nearest])
    if not scale > _ALONE * alone:
        # the one point has all weight: its neighbours lie as they do without
        rows, scale = apart[nearest] / math.sqrt(len(nearest)), alone or 1.0
    rows = np.concatenate([rows, 1e-6 * scale * np.eye(d)])
    factor = linalg.qr(rows, mode="r")[0][:d].T
    factor = factor * np.sign(np.diagonal(factor))
    return Local(transport, Mixture(centre[None], factor[None], np.ones(1)))


def _size(rows: Array) -> float:
    return math.sqrt(float(np.mean(rows**2)))
