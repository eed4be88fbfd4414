"""What a checkpoint has drawn, whichever way it drew."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.importance import WeightedDraws
from inference.posterior.job import Checkpoint, Job, chains
from inference.posterior.verdict import Chains

__all__ = ["Sample", "sample_of"]

Array = NDArray[np.float64]

_WHERE_NOTHING_IS_UNKNOWN = 1000


@dataclasses.dataclass(frozen=True, eq=False)
class Sample:
    """Draws of equal weight.

    Attributes
    ----------
    z : ndarray, shape (ensembles, walkers, steps, d)
        In the prior's normal coordinates. With importance sampling one ensemble of one walker,
        resampled by weight; before the first chunk one walker that visits the starting points.
    log_density : ndarray, shape (ensembles, walkers, steps)
        Collapsed log density.
    chains : Chains or None
        With emcee, after its first chunk: the same draws.
    weighted : WeightedDraws or None
        With importance sampling: the draws before they were resampled.
    """

    z: Array
    log_density: Array
    chains: Chains | None
    weighted: WeightedDraws | None

    @property
    def flat(self) -> Array:
        """All draws, shape (n, d): ensemble by ensemble, walker by walker, step by step."""
        return self.z.reshape(self.log_density.size, self.z.shape[-1])


def sample_of(
    density: CollapsedDensity, job: Job, checkpoint: Checkpoint, rng: np.random.Generator
) -> Sample:
    """Line up the draws of a checkpoint.

    Parameters
    ----------
    density : CollapsedDensity
        The density of the job.
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    rng : numpy.random.Generator
        For resampling by weight.

    Returns
    -------
    Sample
    """
    if checkpoint.weighted is not None:
        weighted = checkpoint.weighted
        keep = rng.choice(len(weighted.z), size=len(weighted.z), p=weighted.weights)
        z, log_density = weighted.z[keep], weighted.log_density[keep]
        return Sample(z[None, None], log_density[None, None], None, weighted)
    if checkpoint.ensembles and checkpoint.ensembles[0].steps >= 4:
        kept = chains(job, checkpoint)
        return Sample(kept.z, kept.log_density, kept, None)
    # nothing unknown, or stopped before the first chunk: the starting points are all there is
    starts = [e.coords for e in checkpoint.ensembles]
    z = np.concatenate(starts or [np.empty((_WHERE_NOTHING_IS_UNKNOWN, 0))])
    return Sample(z[None, None], density(z)[None, None], None, None)
