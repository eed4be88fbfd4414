"""Crosstalk of which the scene states a prior: single frames are served with its uncertainty."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.estimate import estimate
from inference.stated_light import FAINT, stated_light
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor

Array = NDArray[np.float64]

PULSE = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [0.1, 0.1]}})
WAVE = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [0.5, 0.5]}})
SENSORS = {"pulsed": PULSE, "sine_wave": WAVE}
NARROW = [
    {"prior": "normal", "mean": 60.0, "sd": 5.0},
    {"prior": "normal", "mean": -25.0, "sd": 2.5},
]
LEAK = np.array([60.0, -25.0])
PLATE = {"c0": 0.08, "c1": 0.05, "c2": 100.0}
PRIORS: list[dict[str, Any]] = [
    {"prior": "normal", "mean": 3.0, "sd": 0.5},
    {"prior": "halfnormal", "sd": 0.5},
    {"prior": "lognormal", "median": 0.5, "sigma": 0.3},
    {"prior": "lognormal", "median": 0.5, "sigma": 1.0},
    {"prior": "uniform", "low": 1.0, "high": 2.0},
    {"prior": "loguniform", "low": 0.1, "high": 1.0},
    {"prior": "truncated_normal", "mean": 0.0, "sd": 1.0, "low": 0.0, "high": 1.0},
]


def light_of(sensor: Sensor, ranges: Array, flux: Array | float) -> Array:
    """Return readings of objects of any light, shape (n, 2)."""
    if isinstance(sensor, PulsedSensor):
        return np.stack([flux * ranges / sensor.r0, flux * np.ones_like(ranges)], axis=1)
    k = sensor.wave_number
    return np.stack([flux * np.cos(k * ranges), flux * np.sin(k * ranges)], axis=1)


@pytest.mark.parametrize("kind", SENSORS)
def test_object_that_hardly_moves_is_ranged_by_the_prior_as_by_a_joint_law(kind: str) -> None:
    sensor = SENSORS[kind]
    slow = np.linspace(0.8, 0.81, 30)  # differences drown in the noise
    readings = light_of(sensor, slow, 1000.0) + LEAK
    readings += 0.1 * np.random.default_rng(1).standard_normal(readings.shape)
    frames = Frames(readings, time_s=60.0 * np.arange(30.0))
    stated: dict[str, Any] = {"object": PLATE, "crosstalk": NARROW}
    found = estimate(sensor, parse_scene(stated), frames)
    assert (found.chosen, found.do_first) == ("conventional", None)
    assert "differential" in [each.name for each in found.left_out]
    unit = {"mean": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}
    columns = [f"crosstalk.{column}" for column in sensor.columns]
    joint = stated | {"joint": {"unknowns": columns, "modes": [unit]}}
    by_law = estimate(sensor, parse_scene(joint), frames).results[0]
    result = found.results[0]
    np.testing.assert_array_equal(result.range_m, by_law.range_m)
    assert result.sd_parts_m is not None
    assert by_law.sd_parts_m is not None
    # a hundredth of the light: terms of second order are of that size
    np.testing.assert_allclose(result.sd_m, by_law.sd_m, rtol=0.01)
    for part in ("noise", "scene", "model"):
        own, other = getattr(result.sd_parts_m, part), getattr(by_law.sd_parts_m, part)
        np.testing.assert_allclose(own, other, rtol=0.01)


def test_prior_as_wide_as_the_light_is_refused_and_says_what_to_do() -> None:
    wide = [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 2.0}]
    readings = np.array([[0.0242, 0.4230], [0.0162, 0.1711], [0.0108, 0.0771]])
    for asked in (None, ["conventional"]):
        found = estimate(PULSE, parse_scene({"crosstalk": wide}), Frames(readings), asked)
        assert found.chosen is None
        reason = {each.name: each.reason for each in found.left_out}["conventional"]
        assert "take frames without the object for joint_fit" in reason
        assert found.do_first is not None


@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: str(prior["prior"]))
def test_what_a_prior_leaves_open_holds_its_quantiles(prior: dict[str, Any]) -> None:
    scene = parse_scene({"crosstalk": [prior, 0.25]})
    light = stated_light(PULSE, scene)
    assert light is not None
    assert scene.crosstalk_values is not None
    assert light.scene.crosstalk_values is not None
    first = scene.crosstalk_values[0]
    assert not isinstance(first, float | int)
    z = np.array([1.0, 2.0, 3.0, 4.0])
    median, known = light.scene.crosstalk_values
    assert isinstance(median, float)
    off = np.abs(first.distribution().from_normal(np.stack([z, -z])) - median)
    assert (off <= light.sd[0] * z * (1 + 1e-12)).all()
    assert (known, light.sd[1]) == (0.25, 0.0)
    if prior["prior"] == "normal":
        assert light.sd[0] == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: str(prior["prior"]))
def test_ranges_by_a_prior_hold(kind: str, prior: dict[str, Any]) -> None:
    # 300 scenes each with its own crosstalk and light of 2 to 1000 times its size, one frame each
    rng, n = np.random.default_rng(7), 300
    sensor = SENSORS[kind].model_copy(
        update={"noise": SENSORS[kind].noise.model_copy(update={"read": (0.05, 0.05)})}
    )
    scene = parse_scene({"crosstalk": [prior, prior], "discrepancy": 0})
    assert scene.crosstalk_values is not None
    law = scene.crosstalk_values[0]
    assert not isinstance(law, float | int)
    ranges = rng.uniform(0.5, 4.0, n)
    readings = light_of(sensor, ranges, np.exp(rng.uniform(np.log(1.0), np.log(500.0), n)))
    readings += law.distribution().from_normal(rng.standard_normal((n, 2)))
    readings += 0.05 * rng.standard_normal((n, 2))
    result = estimate(sensor, scene, Frames(readings), ["conventional"]).results[0]
    off = (result.range_m - ranges) / result.sd_m
    told = np.isfinite(off)
    assert told.mean() > 0.3
    assert (np.abs(off[told]) < 5).all()
    held = int((np.abs(off[told]) < 1.645).sum())
    # false alarm 1e-6 a case where nine of ten hold, less where more do
    assert stats.binom.cdf(held, int(told.sum()), 0.9) > 1e-6


def test_frames_without_light_have_a_reason_and_no_range() -> None:
    scene = parse_scene({"crosstalk": NARROW})
    readings = light_of(WAVE, np.array([0.8, 0.8]), np.array([1000.0, 10.0])) + LEAK
    result = estimate(WAVE, scene, Frames(readings)).results[0]
    assert np.isfinite(result.range_m).tolist() == [True, False]
    assert result.reasons[result.reason[1]] == FAINT


def test_few_frames_by_a_prior_do_not_go_before_all_by_differences() -> None:
    ranges = np.geomspace(0.3, 1.2, 40)
    flux = 100.0 * 0.08 / (ranges**2 * (ranges**2 + 0.05 * ranges + 0.08))
    readings = light_of(PULSE, ranges, flux)
    wide = [{"prior": "normal", "mean": 0.0, "sd": 40.0}] * 2
    quiet = PULSE.model_copy(
        update={"noise": PULSE.noise.model_copy(update={"read": (1e-6, 1e-6)})}
    )
    frames = Frames(readings, time_s=np.arange(40.0))
    scene = parse_scene({"object": PLATE, "crosstalk": wide})
    found = estimate(quiet, scene, frames)
    assert found.chosen == "differential"
    told = estimate(quiet, scene, frames, ["conventional", "differential"])
    conventional, differential = told.results
    some = np.isfinite(conventional.sd_m).sum()
    assert 0 < some < np.isfinite(differential.sd_m).sum()
    assert told.chosen == "differential"


def test_empty_frames_that_contradict_a_prior_withhold_its_ranges() -> None:
    scene = parse_scene({"crosstalk": NARROW})
    readings = light_of(WAVE, np.full(6, 0.8), 1000.0) + LEAK
    present = np.arange(6) < 3
    for empty, agrees in (([64.0, -23.0], True), ([100.0, -25.0], False)):
        readings[3:] = empty
        found = estimate(WAVE, scene, Frames(readings, object_present=present), ["conventional"])
        assert bool(found.results) is agrees
        if not agrees:
            reason = {each.name: each.reason for each in found.left_out}["conventional"]
            assert "contradict" in reason
