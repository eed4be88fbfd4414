"""The stage in which ensembles walk; what they propose from is fitted anew where they are slow."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.diagnostics import (
    autocorrelation_time,
    effective_sample_size,
    split_r_hat,
)
from inference.posterior.sampling.ensemble import Ensemble, advance, restart
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.verdict import Chains, Verdict, judge
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.chunk import Began, steps_from
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.stage import Tempering, Walking

__all__ = ["WalkTask", "is_slow", "merge", "tasks"]

# steps of autocorrelation above which the proposal is adapted: as often as there are entries
_SLOW = (10.0, 10.0, 40.0)
_PILOT_DRAWS = 10_000
_SHORT_WALK = 400  # steps in which walkers that began at draws agree, or never do


@dataclasses.dataclass(frozen=True, eq=False)
class WalkTask:
    """Some steps of an ensemble.

    Attributes
    ----------
    proposal : Proposal
        Of the ensemble.
    steps : int
        How many.
    """

    job: Job
    proposal: Proposal
    ensemble: Ensemble
    steps: int

    def run(self) -> Ensemble:
        """Carry the ensemble on."""
        density = self.job.density()
        aliases = aliases_of(density)
        return advance(density, self.proposal, self.ensemble, self.steps, aliases)


def tasks(job: Job, stage: Walking) -> tuple[WalkTask, ...]:
    """Return the steps of every ensemble; none where more would serve nothing."""
    if stage.finished:
        return ()
    began: Began = "cold" if stage.weighted is None else "warm"
    if stage.start is not None:
        began = "at draws"
    steps = steps_from(job, stage.steps, stage.ensembles[0].walkers, began)
    return tuple(WalkTask(job, stage.proposal, ensemble, steps) for ensemble in stage.ensembles)


def merge(
    job: Job, stage: Walking, ensembles: Sequence[Ensemble]
) -> tuple[Tempering | Walking, int]:
    """Take in ensembles, and judge the draws so far or adapt the proposal to them.

    Parameters
    ----------
    ensembles : sequence of Ensemble
        In the order of `tasks`.

    Returns
    -------
    (Tempering or Walking, int)
        The next stage, and the density evaluations on the way to it.
    """
    made = sum(ensemble.steps for ensemble in ensembles) - stage.steps * len(ensembles)
    stage = dataclasses.replace(stage, ensembles=tuple(ensembles))
    kept = stage.chains(job.density().parameters.names)
    return _judged(job, stage, kept), made * stage.ensembles[0].walkers


def _judged(job: Job, stage: Walking, kept: Chains) -> Tempering | Walking:
    if stage.start is not None and stage.steps >= _SHORT_WALK:
        # what they began at is doubted: they go on as if from elsewhere
        stage = dataclasses.replace(stage, start=None)
        kept = stage.chains(job.density().parameters.names)
    if stage.start is None and is_slow(kept, stage.adaptations):
        return _adapted(job, stage, kept)
    columns = np.moveaxis(kept.z, -1, 0)
    least = min(effective_sample_size(draws, stage.start) for draws in columns)
    worst = max(split_r_hat(draws) for draws in columns)
    return dataclasses.replace(
        stage,
        verdict=judge(kept, job.settings.target_ess),
        ess=least if math.isfinite(least) else None,
        r_hat=worst if math.isfinite(worst) else None,
    )


def is_slow(kept: Chains, adaptations: int) -> bool:
    """Tell whether the ensembles should propose from something else."""
    if adaptations >= len(_SLOW):
        return False
    steps = kept.z.shape[2]
    times = [autocorrelation_time(x.reshape(-1, steps).T) for x in np.moveaxis(kept.z, -1, 0)]
    # a parameter that does not move has no finite time
    if not max(times) < _SLOW[adaptations]:
        return True
    # populations find the branches that a proposal leaves out; a map fitted to the draws does not
    return adaptations == 0 and kept.stay > _SLOW[0]


def _adapted(job: Job, stage: Walking, kept: Chains) -> Tempering | Walking:
    """Fit the map to what was drawn so far, and forget the draws; or call for populations.

    Populations are called for once: those that died on the way would die again.
    """
    pending = Verdict(False, ("the proposal was still being adapted",))
    old = stage.proposal
    if stage.adaptations == 0:
        return Tempering(old, (None,) * POPULATIONS, pending)
    flat = kept.z.reshape(-1, kept.z.shape[-1])
    pilot = flat[np.linspace(0, len(flat) - 1, min(len(flat), _PILOT_DRAWS)).astype(int)]
    transport = fit_map(pilot, coordinates_of(job.density()))
    new = dataclasses.replace(old, transport=transport, share=MAP_SHARE)
    restarted = tuple(restart(ensemble, old, new) for ensemble in stage.ensembles)
    # an answer until they walk anew, and what they are held to
    known = stage.weighted
    return Walking(new, restarted, pending, stage.adaptations + 1, weighted=known)
