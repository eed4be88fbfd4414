"""Ranges that contradict their prior: answered where they are, and the prior named."""

from typing import Any

import numpy as np
import pytest

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.errors import InvalidInputError
from simulator.frames import Frames, frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.posterior.scenes import OBJECT, data, sensor_of

SETTINGS = SamplerSettings(seed=1, max_seconds=30)


def still(sensor: Sensor, r: float, frames: int) -> Frames:
    scene = parse_scene({"object": OBJECT})
    return simulate(sensor, scene, SampledTrajectory(range_m=[r] * frames), 1).frames


def answer(sensor: Sensor, frames: Frames, range_m: dict[str, Any], **more: Any) -> Posterior:
    scene = parse_scene({"object": OBJECT, "range_m": range_m, "discrepancy": 0, **more})
    return infer(sensor, scene, frames, SETTINGS)


def on_a_grid(sensor: Sensor, frames: Frames, law: dict[str, Any]) -> tuple[float, float]:
    """5 and 95 % points of a common range under a log-normal law, by brute force."""
    assert isinstance(sensor, PulsedSensor)
    u = np.linspace(np.log(0.5), np.log(1.5), 200_001)
    r = np.exp(u)
    light = OBJECT["c0"] * OBJECT["c2"] / (r**2 * (r**2 + OBJECT["c1"] * r + OBJECT["c0"]))
    read = np.asarray(sensor.noise.read)
    log = -0.5 * ((u - np.log(law["median"])) / law["sigma"]) ** 2
    for w1, w2 in frames.readings:
        log -= 0.5 * ((w1 - light * r / sensor.r0) / read[0]) ** 2
        log -= 0.5 * ((w2 - light) / read[1]) ** 2
    share = np.cumsum(np.exp(log - log.max()))
    low, high = np.interp([0.05, 0.95], share / share[-1], r)
    return float(low), float(high)


@pytest.mark.parametrize("motion", ["radial", "static"])
def test_readings_far_outside_a_narrow_prior_are_followed_and_it_is_named(motion: str) -> None:
    """The truth is 14 standard deviations out, beyond any cut of the prior alone."""
    sensor = sensor_of("pulsed", 100.0)
    law = {"prior": "lognormal", "median": 0.5, "sigma": 0.05}
    frames = still(sensor, 1.0, 1)
    found = answer(sensor, frames, law, motion=motion)
    low, high = on_a_grid(sensor, frames, law)
    assert low > 0.9
    # 1,000 draws: the error of a 5 % point is 0.7 % of the mass, a fifth of the width at most
    np.testing.assert_allclose(
        [found.range_m.q05[0], found.range_m.q95[0]], [low, high], atol=0.2 * (high - low)
    )
    # the draws are what the scene states: that it is wrong is said of the model
    assert found.verdict.converged
    assert found.fit.misfit
    (reason,) = (reason for reason in found.fit.reasons if "range_m" in reason)
    assert "next to no mass" in reason
    assert "widen range_m" in reason
    assert all(row.status != "identified" for row in found.identifiability)


@pytest.mark.parametrize("motion", ["radial", "static"])
def test_a_stated_range_that_the_readings_contradict_is_refused(motion: str) -> None:
    """At rest all frames together would fit 38 standard deviations better beyond."""
    sensor = sensor_of("pulsed", 100.0)
    law = {"prior": "uniform", "low": 0.5, "high": 1.0}
    far, frames = (1.01, 100) if motion == "static" else (1.5, 4)
    with pytest.raises(InvalidInputError) as caught:
        answer(sensor, still(sensor, far, frames), law, motion=motion)
    (problem,) = caught.value.problems
    assert problem.pointer == "/scene/range_m"
    assert f"{frames} of {frames} frames would fit far better" in problem.message
    assert "widen it" in problem.message


def test_one_range_of_many_beyond_the_end_is_answered_and_a_misfit() -> None:
    sensor = sensor_of("pulsed", 300.0)
    scene = parse_scene({"object": OBJECT})
    path = SampledTrajectory(range_m=[0.6, 0.7, 0.8, 1.2])
    law = {"prior": "uniform", "low": 0.5, "high": 1.0}
    found = answer(sensor, simulate(sensor, scene, path, 1).frames, law)
    assert found.verdict.converged
    assert found.fit.misfit
    assert any("1 frames pile up at the upper end" in reason for reason in found.fit.reasons)


def test_a_posterior_at_a_stated_end_of_a_prior_is_exact() -> None:
    """The truth lies there: draws pile up, converge, and nothing is wrong."""
    sensor = sensor_of("pulsed", 100.0)
    scene = {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}
    frames = data(sensor, frames=6).frames
    prior = {"prior": "uniform", "low": 0.01, "high": OBJECT["c2"]}
    known = {"prior": "reference", "low": 0.05, "high": 5.0}
    settings = SamplerSettings(seed=1, method="auto", target_ess=100)
    stated = parse_scene({"object": scene | {"c2": prior}, "range_m": known})
    found = infer(sensor, stated, frames, settings)
    assert found.verdict.converged, found.verdict.reasons
    assert not found.fit.misfit
    # a tenth of it is far more than the noise: now the data pull beyond
    prior["high"] = 0.9 * OBJECT["c2"]
    # (of an exact model: the error of the flux that stands by default may be as large)
    stated = parse_scene({"object": scene | {"c2": prior}, "range_m": known, "discrepancy": 0})
    found = infer(sensor, stated, frames, settings)
    assert found.verdict.converged, found.verdict.reasons
    assert found.fit.misfit
    assert any(reason.startswith("object.c2 piles up") for reason in found.fit.reasons)


def test_a_common_range_within_a_narrow_prior_is_no_conflict() -> None:
    sensor = sensor_of("pulsed", 1e7)
    law = {"prior": "uniform", "low": 1.0, "high": 1.000001}
    found = answer(sensor, still(sensor, 1.00000097, 20), law, motion="static")
    assert found.verdict.converged
    assert not found.fit.misfit


def test_ranges_beyond_the_reach_of_a_wave_can_be_judged() -> None:
    noise = {"read": [1e-16, 1e-16]}
    sensor = parse_sensor({"kind": "sine_wave", "frequency_hz": 1e8, "noise": noise})
    frames = frames_from_columns(sensor, {"i": [4.1e-13, 3e-13], "q": [3.5e-13, 4.2e-13]})
    found = answer(sensor, frames, {"prior": "normal", "mean": 300.0, "sd": 10.0})
    assert np.isfinite(found.range_m.q50).all()


def test_a_law_of_no_end_can_be_judged() -> None:
    sensor = sensor_of("pulsed")
    frames = frames_from_columns(sensor, {"w1": [0.0014, 0.0009], "w2": [0.0314, 0.0135]})
    found = answer(sensor, frames, {"prior": "lognormal", "median": 1.0, "sigma": 100.0})
    assert np.isfinite(found.range_m.q50).all()


@pytest.mark.parametrize("prior", ["reference", "stroke"])
def test_a_law_that_rounding_closes_is_refused(prior: str) -> None:
    sensor = sensor_of("pulsed")
    scene = {
        "background": {"strength": 0.01, "distance_m": 5.0},
        "range_m": {"prior": prior, "low": 4.999999999999999, "high": 10.0},
    }
    with pytest.raises(InvalidInputError, match="/range_m/low"):
        infer(sensor, parse_scene(scene), still(sensor, 1.0, 3), SETTINGS)
