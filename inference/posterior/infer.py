"""The fold in a loop: from readings to the posterior in one call."""

import time
from concurrent.futures import Executor

from inference.posterior.fold import merge, prepare, run, start, summarise, tasks
from inference.posterior.posterior import Posterior
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["infer"]


def infer(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    settings: SamplerSettings | None = None,
    executor: Executor | None = None,
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
    begin, cpu = time.perf_counter(), time.process_time()
    settings = SamplerSettings() if settings is None else settings
    job = prepare(sensor, scene, frames, settings)
    checkpoint = start(job)
    while time.perf_counter() - begin < settings.max_seconds:
        chunk = tasks(job, checkpoint)
        if not chunk:
            break
        pieces = list(map(run, chunk) if executor is None else executor.map(run, chunk))
        checkpoint = merge(job, checkpoint, pieces)
    return summarise(job, checkpoint, time.perf_counter() - begin, time.process_time() - cpu)
