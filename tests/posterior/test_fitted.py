"""Starting points from the fit over all frames."""

from typing import Any

import numpy as np
import pytest

from inference.posterior import fold
from inference.posterior.fitted import fitted_optima
from inference.posterior.sampling.start import find_optima
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import (
    Starting,
    Tempering,
    Walking,
    Weighted,
    optima_of,
)
from inference.posterior.stages.starting import begin
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

WALL: dict[str, Any] = {"strength": 0.018, "distance_m": 3.0, "shadow": "object"}
UNKNOWN_WALL: dict[str, Any] = {
    "strength": {"prior": "lognormal", "median": 0.01, "sigma": 1.5},
    "distance_m": {"prior": "lognormal", "median": 5.0, "sigma": 0.7},
    "shadow": "object",
}


def job_of(scene: dict[str, Any], seed: int, snr: float = 1e6) -> fold.Job:
    frames = data(sensor_of("pulsed", snr), {"background": WALL}, 40, span=(1.0, 2.0)).frames
    return fold.prepare(
        sensor_of("pulsed", snr),
        parse_scene(scene),
        frames,
        SamplerSettings(method="emcee", seed=seed),
    )


def test_the_true_valley_is_found_where_a_screen_of_the_prior_sees_false_ones() -> None:
    """Readings a million times above their noise: false valleys lie 2,000 nats below."""
    job = job_of({"background": UNKNOWN_WALL}, 0)
    density = job.density()
    truth = {f"object.{name}": value for name, value in OBJECT.items()}
    truth |= {"background.strength": 0.018, "background.distance_m": 3.0}
    z = density.parameters.standard(np.array([[truth[n] for n in density.parameters.names]]))
    assert find_optima(density, np.random.default_rng(0))[0].log_density < density(z)[0] - 1000.0
    best = max(fitted_optima(job, density), key=lambda optimum: optimum.log_density)
    assert best.log_density > density(z)[0]
    reached = begin(job, Starting())
    assert isinstance(reached.stage, Tempering | Walking | Weighted)
    optima = optima_of(reached.stage)
    assert optima is not None
    # it is begun with errors of the model integrated out, and of these there is one valley
    assert reached.integrated
    erring = job.with_error_integrated().density()
    assert erring(optima.centres).max() > erring(np.array([best.z, z[0]])).max()


@pytest.mark.parametrize(
    "scene",
    [
        {"background": UNKNOWN_WALL, "motion": "static"},
        {"background": UNKNOWN_WALL, "range_m": {"prior": "stroke", "low": 0.1, "high": 3.0}},
    ],
    ids=["at rest", "stroke"],
)
def test_a_fit_of_other_unknowns_is_no_start(scene: dict[str, Any]) -> None:
    job = job_of(scene, 0)
    assert fitted_optima(job, job.density()) == []


def test_a_sensor_whose_pulses_come_late_is_started_without_a_fit() -> None:
    """Fits have no place for a timing offset, be it a known one."""
    sensor = sensor_of("pulsed").model_copy(update={"timing_offset_s": 2e-10})
    frames = data(sensor, frames=8).frames
    job = fold.prepare(sensor, parse_scene({}), frames, SamplerSettings(method="emcee", seed=0))
    assert fitted_optima(job, job.density()) == []
