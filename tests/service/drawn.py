"""Draws without a posterior: quick, and of known shapes."""

import numpy as np
from scipy import signal

from inference.posterior.answer.draws import Draws
from inference.posterior.job import Job, prepare
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

ENSEMBLES, WALKERS, STEPS, THINNED = 4, 6, 50, 5
SATURATED = 2  # of five frames


def job() -> Job:
    """Five frames, one of them saturated."""
    sensor = parse_sensor(
        {
            "kind": "pulsed",
            "pulse_width_s": 1e-7,
            "noise": {"read": [1e-6, 1e-6]},
            "full_scale": [1.0, 1.0],
        }
    )
    readings = np.full((5, 2), 0.01) * np.arange(1.0, 6.0)[:, None]
    readings[SATURATED] = 2.0
    frames = Frames(readings, np.arange(5.0))
    return prepare(sensor, parse_scene({"object": {"c1": 0.0}}), frames, SamplerSettings(seed=3))


def draws(seed: int = 0) -> Draws:
    """Walkers that forget half of where they were at every step."""
    rng = np.random.default_rng(seed)
    shape = (ENSEMBLES, WALKERS, STEPS)
    noise = rng.standard_normal((*shape, 2))
    parameters = signal.lfilter([1.0], [1.0, -0.5], noise, axis=2)
    thinned = np.linspace(0, STEPS - 1, THINNED).astype(np.intp)
    some = (ENSEMBLES, WALKERS, THINNED, 5)
    range_m, likelihood = rng.uniform(0.5, 2.0, some), rng.standard_normal(some)
    readings = rng.standard_normal((*some, 2))
    for values in (range_m, likelihood, readings):
        values[:, :, :, SATURATED] = np.nan
    return Draws(
        ("object.c0", "object.c2"),
        np.asarray(parameters, dtype=np.float64),
        rng.standard_normal(shape),
        np.arange(13, 13 + STEPS),
        rng.random(shape) < 0.5,
        rng.integers(0, 2, shape),
        thinned,
        range_m,
        readings,
        likelihood,
    )
