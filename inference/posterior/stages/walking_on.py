"""Weighted draws that could be the answer, from which ensembles walk: what `emcee` asks for.

They are draws of the posterior already, so that ensembles need not walk until they forget where
they began. What walking adds: it carries walkers to where no weight was drawn, and takes away those
that do not belong where they began; ensembles that began apart are compared; and the last one,
which began at points from the prior, has to come to the same.
"""

import dataclasses

from inference.posterior.job import Job
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import from_draws
from inference.posterior.stages.selecting import sampled
from inference.posterior.stages.stage import Weighted

__all__ = ["WalkOnTask", "tasks"]


@dataclasses.dataclass(frozen=True, eq=False)
class WalkOnTask:
    """The setting up of ensembles behind weighted draws.

    Attributes
    ----------
    job : Job
        As it was sampled.
    stage : Weighted
        With an outset.
    """

    job: Job
    stage: Weighted

    def run(self) -> Checkpoint:
        """Return the ensembles before their first step."""
        assert self.stage.outset is not None  # noqa: S101  # there would be no task
        density = self.job.density()
        after, calls = from_draws(self.job, density, self.stage.draws, self.stage.outset)
        return Checkpoint(after, calls, None, self.job.representatives)


def tasks(job: Job, checkpoint: Checkpoint) -> tuple[WalkOnTask, ...]:
    """Return what sets ensembles up; none where draws are the answer."""
    stage = checkpoint.stage
    if not isinstance(stage, Weighted) or stage.outset is None:
        return ()
    return (WalkOnTask(sampled(job, checkpoint), stage),)
