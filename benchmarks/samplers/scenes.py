"""Scenes on which samplers are compared."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior import fold
from inference.posterior.job import Job
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

FRAMES = 40
STRENGTH = {"prior": "lognormal", "median": 0.018, "sigma": 0.5}
CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2
TRUE_WALL = {"strength": 0.017, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.02}}
# name: what is true beside the object, what is stated; what is left out is unknown
SCENES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "object": ({}, {}),
    "object + crosstalk": ({"crosstalk": [0.002, 0.01]}, {"crosstalk": CROSSTALK}),
    "free shadow": (
        {"background": TRUE_WALL},
        {"background": {"strength": STRENGTH, "distance_m": 3.0}},
    ),
    "everything unknown": (
        {"crosstalk": [0.002, 0.01], "background": TRUE_WALL},
        {
            "crosstalk": CROSSTALK,
            "background": {
                "strength": STRENGTH,
                "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.3},
            },
        },
    ),
}


def problem(name: str, seed: int) -> tuple[Job, CollapsedDensity, NDArray[np.float64]]:
    truth, stated = SCENES[name]
    sensor = sensor_of("pulsed")
    simulation = data(sensor, truth, FRAMES, seed)
    scene = parse_scene(stated)
    job = fold.prepare(sensor, scene, simulation.frames, SamplerSettings(seed=seed))
    density = job.density()
    true: dict[str, Any] = {f"object.{k}": v for k, v in OBJECT.items()}
    if "crosstalk" in truth:
        true |= dict(zip(("crosstalk.w1", "crosstalk.w2"), truth["crosstalk"], strict=True))
    if "background" in truth:
        wall = truth["background"]
        true |= {f"background.shadow.{k}": v for k, v in wall["shadow"].items()}
        true |= {f"background.{k}": wall[k] for k in ("strength", "distance_m")}
    natural = np.array([[true[n] for n in density.parameters.names]])
    return job, density, density.parameters.standard(natural)[0]
