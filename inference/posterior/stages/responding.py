"""Whether linear response to the model's errors stands, and what follows where it does not.

Where errors are to be integrated out (`inference.posterior.stages.integrating`) rounds of
importance draws begin at the moved draws of the exact model. Where these do not come to draws that
can be trusted, or the errors are mostly those of a shadow, what the exact model came to remains the
answer, and says so.
"""

import dataclasses

from inference.posterior.answer.responses import chosen_draws
from inference.posterior.job import Job
from inference.posterior.sample import sample_of
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.integrating import (
    MEMBERS,
    RANKED,
    bending,
    from_moved,
    moved_by,
)
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
        stands = Checkpoint(self.stage, 0, linear=True)
        found = bending(job, density, sample.flat, chosen, rng)
        if found is None:
            return stands
        if isinstance(self.stage, Settled):
            return Checkpoint(Starting(), 0, integrated=True)
        erring = job.with_error_integrated().density()
        flat = sample.flat
        z = flat[rng.choice(len(flat), size=min(MEMBERS, len(flat)), replace=False)]
        stage = from_moved(erring, moved_by(found, z, rng))
        if stage is None:
            return dataclasses.replace(stands, calls=RANKED)
        return Checkpoint(stage, RANKED, integrated=True, exact=self.stage)


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
    """Return the same, or what the exact model came to, or begins with, where such rounds failed.

    Parameters
    ----------
    after : Checkpoint
        With that, where the exact model's errors are being integrated out.
    """
    stage, exact = after.stage, after.exact
    if exact is None or (isinstance(stage, Tempering) and stage.scouted):
        return after
    if isinstance(stage, Weighted):
        return dataclasses.replace(after, exact=None)
    sampled_before = exact.verdict.converged
    return dataclasses.replace(
        after, stage=exact, exact=None, integrated=False, linear=sampled_before
    )
