"""Draws of walkers held to importance sampling, where that can be trusted."""

import numpy as np
from numpy.typing import NDArray

from inference.posterior.importance import MAX_K_HAT, draw_weighted
from inference.posterior.job import Checkpoint, Job
from inference.posterior.verdict import Verdict

__all__ = ["cross_check"]

Array = NDArray[np.float64]

_CHECK_DRAWS = 2000


def cross_check(
    verdict: Verdict, job: Job, checkpoint: Checkpoint, z: Array, ess: float
) -> tuple[Verdict, float | None]:
    """Hold the draws' means to importance sampling, where that can be trusted.

    Parameters
    ----------
    verdict : Verdict
        So far.
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    z : ndarray, shape (n, d)
        Draws.
    ess : float
        Their least effective sample size.

    Returns
    -------
    Verdict
        With a reason more where the means disagree.
    float or None
        Pareto k-hat of the importance weights; None where there is no proposal.
    """
    if checkpoint.proposal is None:
        return verdict, None
    weighted = draw_weighted(job.density(), checkpoint.proposal, job.stream(5), _CHECK_DRAWS)
    if not weighted.k_hat < MAX_K_HAT or not weighted.ess > 100:
        return verdict, weighted.k_hat
    other = weighted.weights @ weighted.z
    error = np.sqrt(weighted.weights**2 @ (weighted.z - other) ** 2 + z.var(axis=0) / max(ess, 1.0))
    worst = float(np.max(np.abs(other - z.mean(axis=0)) / error))
    if worst > 6.0:
        reason = f"means differ from importance sampling by {worst:.0f} standard errors"
        return Verdict(False, (*verdict.reasons, reason)), weighted.k_hat
    return verdict, weighted.k_hat
