"""The fold in a loop: from readings to the posterior in one call."""

import dataclasses
import functools
import time
from collections.abc import Callable
from concurrent.futures import Executor

from inference.posterior.answer.posterior import Posterior
from inference.posterior.fold import (
    Progress,
    merge,
    prepare,
    progress,
    run,
    start,
    summarise,
    tasks,
)
from inference.posterior.pace import Pace
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.processor_time import timed
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["infer"]


def infer(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    settings: SamplerSettings | None = None,
    executor: Executor | None = None,
    report: Callable[[Progress], None] | None = None,
) -> Posterior:
    """Infer parameters and ranges.

    Parameters
    ----------
    sensor, scene, frames : Sensor, Scene, Frames
        What was read, by what, of what.
    settings : SamplerSettings, optional
        Defaults: emcee, 4 ensembles, 400 effective draws, 120 s, a seed that is drawn.
    executor : concurrent.futures.Executor, optional
        Runs the ensembles side by side; the answer is the same without.
    report : callable, optional
        Is told how far it is: before the start and after every chunk.

    Returns
    -------
    Posterior
        Also where it has not converged: `Posterior.verdict` says so.

    Raises
    ------
    InvalidInputError
        Where the request breaks a rule.
    RefusedError
        Where no honest answer exists.
    """
    begin, pace = time.perf_counter(), None
    tell: Callable[[Progress], None] = report or (lambda _: None)
    tell(Progress("starting", 0, None, None, None, False))
    settings = SamplerSettings() if settings is None else settings
    job = prepare(sensor, scene, frames, settings)
    checkpoint, cpu_s = timed(start, job)
    wall_s = time.perf_counter() - begin
    reached = progress(job, checkpoint)
    tell(reached)
    while chunk := tasks(job, checkpoint, cpu_s):
        timed_run = functools.partial(timed, run)
        done = list(map(timed_run, chunk) if executor is None else executor.map(timed_run, chunk))
        checkpoint, spent = timed(merge, job, checkpoint, [piece for piece, _ in done])
        cpu_s += spent + sum(seconds for _, seconds in done)
        wall_s = time.perf_counter() - begin
        reached = progress(job, checkpoint)
        pace = Pace.followed(pace, reached, wall_s)
        tell(pace.foretell(reached, wall_s))
    posterior, spent = timed(summarise, job, checkpoint, wall_s, cpu_s)
    wall_s, cpu_s = time.perf_counter() - begin, cpu_s + spent
    runtime = dataclasses.replace(posterior.runtime, wall_s=wall_s, cpu_s=cpu_s)
    return dataclasses.replace(posterior, runtime=runtime)
