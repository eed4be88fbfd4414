"""The fold of a posterior in short chunks, counted and not timed: the same on every machine.

A few hundred effective draws are enough for a study, and a whole chunk of a service gives ten times
as many.
"""

import dataclasses

from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.sampling.verdict import MAX_R_HAT
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.walking import WalkTask
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Sampled", "sample"]

_MOST_CHUNKS = 80
_MOST_STEPS = 130


@dataclasses.dataclass(frozen=True, eq=False)
class Sampled:
    """A posterior, and how far its sampling came."""

    job: fold.Job
    posterior: Posterior
    ess: float | None
    rhat: float | None


def _shortened(task: fold.Task) -> fold.Task:
    """Shorten the walk of an ensemble; other tasks are left as they are."""
    if isinstance(task, WalkTask):
        return dataclasses.replace(task, steps=min(task.steps, _MOST_STEPS))
    return task


def sample(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    settings: SamplerSettings,
    every_gate: bool = True,
) -> Sampled:
    """Infer until the settings are met, or for eighty short chunks.

    Parameters
    ----------
    sensor, scene, frames, settings
        As of `inference.posterior.infer.infer`; the wall time plays no part.
    every_gate : bool
        Whether to sample until the whole verdict is passed. Otherwise the effective sample size and
        R-hat decide, which is enough for quantiles of a range and takes a third of the time.

    Raises
    ------
    RefusedError
        Where no honest answer exists.
    """
    job = fold.prepare(sensor, scene, frames, settings)
    checkpoint = fold.start(job)
    for _ in range(_MOST_CHUNKS):
        tasks = fold.tasks(job, checkpoint)
        reached = fold.progress(job, checkpoint)
        enough = (
            reached.ess is not None
            and reached.rhat is not None
            and reached.ess >= settings.target_ess
            and reached.rhat <= MAX_R_HAT
        )
        if not tasks or (enough and not every_gate):
            break
        checkpoint = fold.merge(job, checkpoint, [fold.run(_shortened(task)) for task in tasks])
    reached = fold.progress(job, checkpoint)
    return Sampled(job, fold.summarise(job, checkpoint, 0.0, 0.0), reached.ess, reached.rhat)
