"""A job whose crosstalk and background are confounded, and whose width is the model's errors."""

import functools
from typing import Any

from benchmarks.hard_posteriors import SCENES, SENSORS, TRUTH
from inference.posterior.job import Job, prepare
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

__all__ = ["confounded"]

_SCENE = "crosstalk, background, R known"


@functools.cache
def confounded(snr: float = 1000.0, seed: int = 1, kind: str = "sine_wave", **settings: Any) -> Job:
    """Return sixteen frames of an unknown object before an unknown wall and unknown crosstalk.

    Parameters
    ----------
    snr : float
        Of the object at 1 m.
    seed : int
        Of readings and job.
    kind : str
        Of the sensor.
    **settings
        Of the sampler, besides.
    """
    read = 7.7e-3 / snr
    sensor = parse_sensor({**SENSORS[kind], "noise": {"read": [read, read]}})
    terms = SCENES[_SCENE]
    truth = {name: TRUTH[name] for name in ("object", *terms)}
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=16, spacing="log")
    frames = simulate(sensor, parse_scene(truth), path, seed).frames
    return prepare(
        sensor,
        parse_scene(terms),
        frames,
        SamplerSettings.model_validate({"seed": seed, "method": "auto", **settings}),
    )
