"""Simulation-based calibration: truths from the prior, their ranks among the posterior's draws.

Talts et al. (2018). Ranges are ranked at fixed frame indices, never by their true value.
"""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior import fold
from inference.posterior.ranges import draw_ranges
from inference.posterior.settings import SamplerSettings
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.posterior.scenes import KINDS, SIGNAL_AT_1M

FRAMES = 12
LOW, HIGH = 0.1, 2.0  # ranges [m], their logarithm uniform


@dataclasses.dataclass(frozen=True)
class Ranks:
    """Ranks in (0, 1) of one data set's truths, by name, and whether the run converged."""

    values: dict[str, float]
    converged: bool


def setting(kind: str, crosstalk: bool, snr: float) -> tuple[Sensor, Scene]:
    """Return a sensor and a scene whose unknowns have moderate priors."""
    read = SIGNAL_AT_1M / snr
    scene: dict[str, Any] = {
        "object": {
            "c0": {"prior": "lognormal", "median": 0.08, "sigma": 0.7},
            "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.5},
        },
        "range_m": {"prior": "loguniform", "low": LOW, "high": HIGH},
    }
    if crosstalk:
        scene["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": SIGNAL_AT_1M}] * 2
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [read, read]}})
    return sensor, parse_scene(scene)


def ranks(sensor: Sensor, scene: Scene, seed: int) -> Ranks:
    """Draw a truth and its readings, infer, rank."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(77,)))
    truth = np.exp(rng.uniform(np.log(LOW), np.log(HIGH), FRAMES))
    simulation = simulate(sensor, scene, SampledTrajectory(range_m=truth.tolist()), rng)
    settings = SamplerSettings(seed=seed, target_ess=200)
    job = fold.prepare(sensor, scene, simulation.frames, settings)
    checkpoint = fold.start(job)
    for _ in range(6):  # counted, not timed: the same ranks on every machine
        pieces = [fold.run(task) for task in fold.tasks(job, checkpoint)]
        if not pieces:
            break
        checkpoint = fold.merge(job, checkpoint, pieces)
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    draws = posterior.draws.parameters.reshape(-1, len(posterior.draws.names))
    values = {
        name: _rank(draws[:, j], simulation.parameters[name], rng)
        for j, name in enumerate(posterior.draws.names)
    }
    parameters = parameters_of(sensor, scene)
    z = parameters.standard(draws[np.linspace(0, len(draws) - 1, 400).astype(int)])
    drawn = draw_ranges(job.density(), z, rng)
    for frame in (0, FRAMES // 2):
        values[f"range {frame}"] = _rank(np.exp(drawn[:, frame]), truth[frame], rng)
    return Ranks(values, posterior.verdict.converged)


def _rank(draws: NDArray[np.float64], truth: float, rng: np.random.Generator) -> float:
    thinned = rng.choice(draws, size=200, replace=False)
    return float((np.sum(thinned < truth) + rng.random()) / 201)
