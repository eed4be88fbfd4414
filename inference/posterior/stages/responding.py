"""Whether linear response to the model's errors stands, and what follows where it does not.

Draws of an exact model are moved by its errors along straight lines. Where the next order would
change that by much, and it is most of what the answer does not know, the error of the flux is
integrated out in full: rounds of importance draws begin at the moved draws. Where these do not come
to draws that can be trusted, or the errors are mostly those of a shadow, what the exact model came
to remains the answer, and says so.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.moves import Moves
from inference.posterior.answer.responses import (
    Responses,
    chosen_draws,
    first_responses,
    flux_leads,
    repeated,
)
from inference.posterior.criticism.discrepancy_check import is_bent, may_be_bent, misses
from inference.posterior.criticism.prior_conflict import are_far_out
from inference.posterior.job import Job
from inference.posterior.sample import Sample, sample_of
from inference.posterior.sampling.population import arrived_at
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.start import Optimum, added, climb, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.optima import that_matter
from inference.posterior.stages.selecting import sampled
from inference.posterior.stages.stage import (
    Drawing,
    Selecting,
    Settled,
    Starting,
    Tempering,
    Weighted,
)
from inference.posterior.streams import Stream

__all__ = ["RespondTask", "decided", "tasks"]

Array = NDArray[np.float64]

_MEMBERS = 400  # draws that are moved
_CLIMBS = 2  # from the best of them


@dataclasses.dataclass(frozen=True, eq=False)
class RespondTask:
    """How the draws of an exact model follow its errors.

    Attributes
    ----------
    job : Job
        As it was sampled.
    stage : Drawing
        What that came to.
    """

    job: Job
    stage: Drawing

    def run(self) -> Checkpoint:
        """Return where the job stands, or begins anew with the errors integrated out."""
        job, density = self.job, self.job.density()
        rng = job.stream(Stream.RESPONSE)
        sample = sample_of(density, self.stage, rng)
        chosen = sample.flat[chosen_draws(len(sample.flat), len(density.frames))]
        log_r = density.draw_log_ranges(chosen, rng)
        stands = Checkpoint(self.stage, 0, linear=True)
        if not np.isfinite(log_r[0]).any():
            return stands
        by_noise = float(log_r[:, np.isfinite(log_r[0])].mean(axis=1).std())
        found = first_responses(job, density, chosen, log_r, rng)
        # a prior that the readings contradict is to be named, not explained by errors of the model
        may_miss = not are_far_out(density, sample.flat)
        if not _bent(may_be_bent, found, by_noise, may_miss):
            return stands
        found = repeated(job, found, rng)
        if not _bent(is_bent, found, by_noise, may_miss):
            return stands
        if not flux_leads(found):  # a shadow's is not integrated
            return stands
        if isinstance(self.stage, Settled):
            return Checkpoint(Starting(), 0, integrated=True)
        erring = job.with_error_integrated().density()
        stage = _from_moved(erring, _moved(sample, found, rng))
        if stage is None:
            return dataclasses.replace(stands, calls=_MEMBERS)
        return Checkpoint(stage, _MEMBERS, integrated=True, exact=self.stage)


def _bent(
    test: Callable[[float, float, float], bool], found: Responses, by_noise: float, may_miss: bool
) -> bool:
    """Tell whether the response bends, of the scale or by what it misses of an unknown."""
    model = found.of_scale
    bent = test(model, math.hypot(model, by_noise), found.curvature)
    return bent or (may_miss and misses(found.missed))


def tasks(job: Job, checkpoint: Checkpoint) -> tuple[RespondTask, ...]:
    """Return what is left to do where sampling is finished: to look at the response, once.

    What was asked for by importance alone stays that of the Laplace shapes: the rows of the answer
    say what linear response leaves open.
    """
    stage = checkpoint.stage
    assert not isinstance(stage, Selecting | Starting)  # noqa: S101  # sampling is finished
    reached, own = stage.verdict.converged, sampled(job, checkpoint)
    may = job.settings.method != "importance" or isinstance(stage, Settled)
    if checkpoint.linear or not (reached and may and own.can_integrate_error):
        return ()
    return (RespondTask(own, stage),)


def decided(after: Checkpoint) -> Checkpoint:
    """Return the same, or what the exact model came to where rounds from its draws failed.

    Parameters
    ----------
    after : Checkpoint
        With what the exact model came to, where its errors are being integrated out.
    """
    stage, exact = after.stage, after.exact
    if exact is None or (isinstance(stage, Tempering) and stage.scouted):
        return after
    if isinstance(stage, Weighted):
        return dataclasses.replace(after, exact=None)
    return dataclasses.replace(after, stage=exact, exact=None, integrated=False, linear=True)


def _moved(sample: Sample, found: Responses, rng: np.random.Generator) -> Array:
    """Return some draws, moved by random errors."""
    flat = sample.flat
    z = flat[rng.choice(len(flat), size=min(_MEMBERS, len(flat)), replace=False)]
    moves = Moves(found.z, found.log_r, found.by_z, found.by_log_r)
    return moves.moved(z, moves.errors(len(z), rng))


def _from_moved(density: CollapsedDensity, z: Array) -> Tempering | None:
    """Set up rounds of importance draws from points; None where the density leaves too few."""
    value = density(z)
    z, value = z[np.isfinite(value)], value[np.isfinite(value)]
    if len(z) <= 2 * z.shape[1]:
        return None
    optima: list[Optimum] = []
    for i in np.argsort(-value)[:_CLIMBS]:
        optima = added(optima, refine(density, climb(density, z[i])[0]))
    if not optima:
        return None
    proposal = Proposal(mixture_of(that_matter(optima)), None, MAP_SHARE)
    pending = Verdict(False, ("no steps were made",))
    return Tempering(proposal, (arrived_at(z),), pending, scouted=True)
