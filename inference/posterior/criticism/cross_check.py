"""Draws of walkers held to the density itself: a better branch, another way to the same means.

Whatever walkers say about one another, all of them may be in the wrong place.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.diagnostics import effective_sample_size
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.quadrature import MOST_DIMENSIONS, Moments, lattice_moments
from inference.posterior.sampling.verdict import Chains

__all__ = ["cross_check", "false_branch", "moments_disagree"]

Array = NDArray[np.float64]
LogDensity = Callable[[Array], Array]

_CHECK_DRAWS = 2000
_LEAST_ESS = 100  # of the importance draws that are compared
_FALSE_BRANCH = 10.0  # nats from an optimum down to the best draw
_STANDARD_ERRORS = 6.0
_INNER = (0.001, 0.999)  # quantiles of the draws that the lattice starts from; it grows
_EVALUATIONS = 600_000  # of one frame, for the lattice
_FRAME_DRAWS = 20_000
_THINNEST = 1e-10  # extent of the draws along their last axis, by that along their first
_NEGLIGIBLE = 15.0  # nats below the best draw
_ROUNDING = 1e-9


def cross_check(
    density: CollapsedDensity,
    chains: Chains,
    proposal: Proposal,
    weighted: WeightedDraws | None,
    rng: np.random.Generator,
) -> tuple[tuple[str, ...], float]:
    """Hold draws to the optima that are known, to importance sampling and to quadrature.

    Parameters
    ----------
    proposal : Proposal
        What they were proposed from.
    weighted : WeightedDraws or None
        Importance draws that there are already; None where they are to be drawn from the proposal.
    rng : numpy.random.Generator
        For importance sampling.

    Returns
    -------
    tuple of str
        The reasons to doubt them, if any.
    float
        Pareto k-hat of the importance weights.
    """
    if weighted is None:
        weighted = draw_weighted(density, proposal, rng, _CHECK_DRAWS)
    points = _EVALUATIONS // max(len(density.frames), 1)
    found = (
        false_branch(density, chains, proposal.optima),
        moments_disagree(density, chains, proposal.optima, weighted, points),
    )
    return tuple(reason for reason in found if reason is not None), weighted.k_hat


def false_branch(density: LogDensity, chains: Chains, optima: Mixture) -> str | None:
    """Tell whether an optimum is known that is better than any draw, and holds more mass.

    Parameters
    ----------
    density : callable
        Log density of points (n, d).
    optima : Mixture
        Laplace approximations of all optima that are known.

    Returns
    -------
    str or None
        The reason. Of a thousand draws of a normal law in 20 dimensions the best is 4 nats below
        the top; ten are never reached by chance. A spike without mass is no finding.
    """
    d = chains.z.shape[-1]
    values = density(optima.centres)
    logdets = np.log(np.abs(np.diagonal(optima.factors, axis1=1, axis2=2))).sum(axis=1)
    top = float(chains.log_density.max())
    covariance = np.cov(chains.z.reshape(-1, d).T).reshape(d, d)
    mass = top + 0.5 * float(np.linalg.slogdet(covariance)[1])
    gaps = np.where(values + logdets > mass, values - top, -math.inf)
    if gaps.max() > _FALSE_BRANCH:
        return (
            f"the walkers are in a false branch: an optimum is known {gaps.max():.0f} nats above "
            "the best of their draws"
        )
    return None


def moments_disagree(
    density: LogDensity,
    chains: Chains,
    optima: Mixture,
    weighted: WeightedDraws,
    points: int,
) -> str | None:
    """Compare means, mean squares and mode weights with importance sampling and quadrature.

    Parameters
    ----------
    density : callable
        Log density of points (n, d).
    optima : Mixture
        What tells the modes apart.
    weighted : WeightedDraws
        Draws from a proposal; compared where Pareto k-hat is below 0.5.
    points : int
        Evaluations allowed to the quadrature, which is tried in up to three dimensions.

    Returns
    -------
    str or None
        The reason: a difference above six standard errors.
    """
    frame = _principal_frame(chains)
    if frame is None:
        return None  # some parameter does not move: the length gate has named it
    white = frame.white(chains.z)
    own = _own_moments(white, chains.start)
    estimates: list[tuple[str, Moments]] = []
    trusted = weighted.k_hat < MAX_K_HAT and weighted.ess > _LEAST_ESS
    if white.shape[-1] <= MOST_DIMENSIONS and not trusted:
        around = frame.white(_surroundings(density, chains, optima))
        low, high = np.quantile(white.reshape(-1, white.shape[-1]), _INNER, axis=0)
        low, high = np.minimum(low, around.min(axis=0)), np.maximum(high, around.max(axis=0))
        exact = lattice_moments(lambda y: density(frame.natural(y)), low, high, points)
        if exact is not None:
            estimates.append(("quadrature", exact))
    if trusted:
        reason = _mode_weights(chains, optima, weighted)
        if reason is not None:
            return reason
        other = _weighted_moments(frame.white(weighted.z), weighted.weights)
        estimates.append(("importance sampling", other))
    for method, other in estimates:
        for what, difference, error in (
            ("means", own.first - other.first, np.hypot(own.first_error, other.first_error)),
            (
                "variances",
                own.second - other.second,
                np.hypot(own.second_error, other.second_error),
            ),
        ):
            worst = float(np.max(np.abs(difference) / error))
            if worst > _STANDARD_ERRORS:
                return f"{what} differ from {method} by {worst:.0f} standard errors"
    return None


@dataclasses.dataclass(frozen=True, eq=False)
class _Frame:
    """Principal axes of draws, with unit spread along each: a thin posterior fills its box."""

    centre: Array
    spread: Array
    extent: Array
    turn: Array

    def white(self, z: Array) -> Array:
        return np.asarray(((z - self.centre) / self.spread) @ self.turn.T / self.extent)

    def natural(self, y: Array) -> Array:
        return np.asarray(self.centre + ((y * self.extent) @ self.turn) * self.spread)


def _principal_frame(chains: Chains) -> _Frame | None:
    flat = chains.z.reshape(-1, chains.z.shape[-1])
    flat = flat[np.linspace(0, len(flat) - 1, min(len(flat), _FRAME_DRAWS)).astype(int)]
    centre, spread = flat.mean(axis=0), flat.std(axis=0)
    if not (spread > 0).all():
        return None
    _, values, vectors = scipy.linalg.svd((flat - centre) / spread, full_matrices=False)
    if not values.min() > _THINNEST * values.max():
        return None
    return _Frame(centre, spread, values / math.sqrt(len(flat)), vectors)


def _surroundings(density: LogDensity, chains: Chains, optima: Mixture) -> Array:
    """Return points around every known optimum that may hold some of the mass."""
    values = density(optima.centres)
    near = values > chains.log_density.max() - _NEGLIGIBLE
    columns = 3.0 * np.swapaxes(optima.factors[near], 1, 2)
    centres = optima.centres[near][:, None]
    points = np.concatenate([centres + columns, centres - columns], axis=1)
    return np.concatenate([points.reshape(-1, chains.z.shape[-1]), chains.z[:, :, -1].mean(axis=1)])


def _own_moments(white: Array, start: float | None) -> Moments:
    """Moments of the draws with their Monte Carlo errors."""
    columns = []
    for x in np.moveaxis(white, -1, 0):
        for power in (x, x * x):
            ess = effective_sample_size(power, start)
            columns.append((power.mean(), power.std() / math.sqrt(max(ess, 1.0))))
    first, second = np.array(columns).reshape(-1, 2, 2).transpose(1, 2, 0)
    return Moments(first[0], second[0], first[1], second[1])


def _weighted_moments(y: Array, weights: Array) -> Moments:
    def mean_and_error(x: Array) -> tuple[Array, Array]:
        mean = weights @ x
        return mean, np.sqrt(weights**2 @ (x - mean) ** 2)

    first, first_error = mean_and_error(y)
    second, second_error = mean_and_error(y * y)
    return Moments(first, second, first_error, second_error)


def _mode_weights(chains: Chains, optima: Mixture, weighted: WeightedDraws) -> str | None:
    """Compare the weights of the modes, also of those that no walker ever entered."""
    labels = optima.nearest(weighted.z)
    for k in range(len(optima.weights)):
        inside = (labels == k).astype(float)
        weight = float(weighted.weights @ inside)
        error = float(np.sqrt(weighted.weights**2 @ (inside - weight) ** 2))
        mine = (chains.mode == k).astype(float)
        ess = effective_sample_size(mine, chains.start)
        # a mode entered in some ensembles and left by none has no time of autocorrelation; then
        # the importance draws alone say how far off its weight may be
        own_error = float(mine.std()) / math.sqrt(max(ess, 1.0)) if math.isfinite(ess) else 0.0
        if chains.start is not None:  # how many begin in a mode, and stay there, is chance
            least = weight * (1.0 - weight) / math.prod(mine.shape[:2])
            own_error = max(own_error, math.sqrt(max(least, 0.0)))
        if abs(weight - mine.mean()) > _STANDARD_ERRORS * math.hypot(error, own_error) + _ROUNDING:
            return (
                f"mode {k + 1} has {mine.mean():.1%} of the draws and {weight:.1%} by importance "
                "sampling"
            )
    return None
