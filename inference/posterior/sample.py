"""What a job has drawn, whichever way it drew."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.proposal import Mixture
from inference.posterior.sampling.verdict import Chains
from inference.posterior.stages.stage import Drawing, Settled, Walking, Weighted

__all__ = ["Sample", "sample_of"]

Array = NDArray[np.float64]

_SETTLED_DRAWS = 1000  # of the ranges alone
_LEAST_STEPS = 4  # of which anything is said


@dataclasses.dataclass(frozen=True, eq=False)
class Sample:
    """Draws of equal weight.

    Attributes
    ----------
    z : ndarray, shape (ensembles, walkers, steps, d)
        In the prior's normal coordinates. With importance sampling one ensemble of one walker,
        resampled by weight; before the first chunk there are none.
    log_density : ndarray, shape (ensembles, walkers, steps)
        Collapsed log density.
    step : ndarray of int, shape (steps,)
        Number of each step, the burn-in counted.
    accepted : ndarray of bool, shape (ensembles, walkers, steps)
        Whether the walker moved in that step.
    mode : ndarray of int, shape (ensembles, walkers, steps)
        Index of the optimum that each draw belongs to.
    chains : Chains or None
        With emcee, after its first chunk: the same draws.
    weighted : WeightedDraws or None
        With importance sampling: the draws before they were resampled.
    resampled : ndarray, shape (1, 1, steps), or None
        With importance sampling: the weight that each draw had before.
    """

    z: Array
    log_density: Array
    step: NDArray[np.intp]
    accepted: NDArray[np.bool_]
    mode: NDArray[np.intp]
    chains: Chains | None
    weighted: WeightedDraws | None
    resampled: Array | None = None

    @property
    def drawn(self) -> bool:
        """Whether there are draws of the posterior, or all is known."""
        return self.chains is not None or self.weighted is not None or self.z.shape[-1] == 0

    @property
    def flat(self) -> Array:
        """All draws, shape (n, d): ensemble by ensemble, walker by walker, step by step."""
        return self.z.reshape(self.log_density.size, self.z.shape[-1])


def sample_of(density: CollapsedDensity, stage: Drawing, rng: np.random.Generator) -> Sample:
    """Line up the draws of a stage.

    Parameters
    ----------
    rng : numpy.random.Generator
        For resampling by weight.
    """
    match stage:
        case Walking() if stage.steps >= _LEAST_STEPS:
            return _walked(density, stage)
        case Weighted():
            weighted = stage.draws
            keep = rng.choice(len(weighted.z), size=len(weighted.z), p=weighted.weights)
            z, log_density = weighted.z[keep], weighted.log_density[keep]
            lined_up = _lined_up(z, log_density, stage.optima, weighted)
            return dataclasses.replace(lined_up, resampled=weighted.weights[None, None, keep])
        case Settled():
            z, optima = np.empty((_SETTLED_DRAWS, 0)), None
        case _:  # stopped before the first chunk: starting points are no draws
            z, optima = np.empty((0, len(density.parameters))), stage.proposal.optima
    return _lined_up(z, density(z), optima, None)


def _walked(density: CollapsedDensity, stage: Walking) -> Sample:
    kept = stage.chains(density.parameters.names)
    step = np.arange(stage.steps - kept.z.shape[2], stage.steps)
    every = np.array([e.chain[step[0] - 1 :].transpose(1, 0, 2) for e in stage.ensembles])
    moved = np.any(np.diff(every, axis=2) != 0, axis=-1)
    return Sample(kept.z, kept.log_density, step, moved, kept.mode, kept, None)


def _lined_up(
    z: Array, log_density: Array, optima: Mixture | None, weighted: WeightedDraws | None
) -> Sample:
    """Return points as the steps of one walker."""
    n = len(z)
    mode = np.zeros(n, dtype=np.intp) if optima is None else optima.nearest(z)
    return Sample(
        z[None, None],
        log_density[None, None],
        np.arange(n),
        np.ones((1, 1, n), dtype=bool),
        mode[None, None],
        None,
        weighted,
    )
