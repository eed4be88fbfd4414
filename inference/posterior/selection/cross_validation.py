"""The cross-validated predictive density of a model, influential frames treated on their own.

A frame that the draws given all frames lean on (k-hat above 0.7) is predicted from new draws, whose
proposal is adapted to the posterior without it.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.importance import draw_weighted
from inference.posterior.sampling.proposal import Mixture
from inference.posterior.selection.evidence import Weighed, adapt, resample
from inference.posterior.selection.leave_one_out import MAX_K_HAT, LeaveOneOut, leave_one_out

__all__ = ["cross_validate"]

Array = NDArray[np.float64]

_DRAWS = 2000
_MOST_EVALUATIONS = 200_000  # of a frame, in one round: fewer draws where frames are many
_LEAST_DRAWS = 400
_DEPENDENT_DRAWS = 300  # where frames depend on one another given the parameters
_MOST_DEPENDENT = 60  # frames, each of which is then left out in turn
_MOST_INFLUENTIAL = 6  # frames; the others keep a k-hat that says what they are worth
_ROUNDS = 3


def _without(density: CollapsedDensity, frame: int) -> CollapsedDensity:
    """Return the density of all frames but one."""
    present = density.present
    return dataclasses.replace(
        density,
        frames=np.delete(density.frames, frame, axis=0),
        present=None if present is None else np.delete(present, frame),
    )


def _given_others(density: CollapsedDensity, z: Array, frame: int) -> Array:
    """Return log p(y_frame | the other frames, z), shape (len(z),)."""
    if type(density) is CollapsedDensity:  # frames are independent given z
        return density.frame_log_likelihoods(z)[:, frame]
    return density.log_likelihood(z) - _without(density, frame).log_likelihood(z)


def _predict(
    density: CollapsedDensity,
    frame: int,
    laplace: Mixture,
    pilot: Array,
    rng: np.random.Generator,
) -> tuple[float, float, int]:
    """Predict one frame from the others; its log density, k-hat, and the number of evaluations."""
    others = _without(density, frame)
    n = int(np.clip(_MOST_EVALUATIONS / len(density.frames), _LEAST_DRAWS, _DRAWS))
    best, k_hat, calls = -np.inf, np.inf, 0
    for _ in range(_ROUNDS):
        weighted = draw_weighted(others, adapt(laplace, pilot, others), rng, n)
        calls += n
        if weighted.k_hat < k_hat:
            inside = weighted.weights > 0
            logs = np.log(weighted.weights[inside])
            found = _given_others(density, weighted.z[inside], frame)
            calls += len(found)
            best, k_hat = float(scipy.special.logsumexp(logs + found)), weighted.k_hat
        if k_hat < MAX_K_HAT or not np.isfinite(weighted.log_evidence):
            break
        pilot = weighted.z[resample(weighted, rng, _DRAWS)]
    return best, k_hat, calls


def _draws(weighed: Weighed, independent: bool, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return not too many of the draws, and the logs of their weights."""
    kept = np.flatnonzero(np.isfinite(weighed.log_weights))
    logs = weighed.log_weights[kept]
    if independent:
        chosen = np.linspace(0, kept.size - 1, min(kept.size, _DRAWS)).astype(int)
        return weighed.z[kept[chosen]], logs[chosen]
    chosen = rng.choice(kept.size, size=_DEPENDENT_DRAWS, p=scipy.special.softmax(logs))
    return weighed.z[kept[chosen]], np.zeros(_DEPENDENT_DRAWS)


def cross_validate(
    density: CollapsedDensity, weighed: Weighed, rng: np.random.Generator
) -> tuple[LeaveOneOut, int]:
    """Predict every frame from all others.

    Parameters
    ----------
    weighed : Weighed
        Its posterior.

    Returns
    -------
    LeaveOneOut
        Minus infinity throughout where no parameters explain the frames; nan with k-hat infinite
        where frames depend on one another and are too many to be left out one by one.
    int
        Density evaluations.
    """
    n = len(density.frames)
    if not np.isfinite(weighed.evidence.log_evidence):
        return LeaveOneOut(np.full(n, -np.inf), np.full(n, -np.inf)), 0
    independent = type(density) is CollapsedDensity  # frames, given z
    if not independent and n > _MOST_DEPENDENT:
        return LeaveOneOut(np.full(n, np.nan), np.full(n, np.inf)), 0
    z, log_weights = _draws(weighed, independent, rng)
    if independent:
        likelihoods, calls = density.frame_log_likelihoods(z), len(z)
    elif n == 1:
        # nothing is known without the only frame
        likelihoods, calls = density.log_likelihood(z)[:, None], len(z)
    else:
        columns = [_given_others(density, z, frame) for frame in range(n)]
        likelihoods, calls = np.column_stack(columns), 2 * n * len(z)
    if len(density.parameters) == 0:
        return LeaveOneOut(likelihoods[0], np.full(n, -np.inf)), calls
    found = leave_one_out(likelihoods, log_weights)
    influential = np.flatnonzero(found.k_hat > MAX_K_HAT)
    influential = influential[np.argsort(-found.k_hat[influential])][:_MOST_INFLUENTIAL]
    if weighed.laplace is None or n < 2 or not np.isfinite(likelihoods).all():
        return found, calls
    predictive, k_hat = found.log_predictive.copy(), found.k_hat.copy()
    for frame in influential:
        # the square root of the weights: half the way to the posterior without the frame
        logs = log_weights - 0.5 * likelihoods[:, frame]
        weights = np.exp(logs - logs.max())
        pilot = z[rng.choice(len(z), size=_DRAWS, p=weights / weights.sum())]
        value, shape, used = _predict(density, int(frame), weighed.laplace, pilot, rng)
        calls += used
        if shape < k_hat[frame]:
            predictive[frame], k_hat[frame] = value, shape
    return LeaveOneOut(predictive, k_hat), calls
