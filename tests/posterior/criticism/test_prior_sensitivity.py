"""What rests on the law of the ranges is not called identified, nor is it narrow."""

from typing import Any

import numpy as np
import pytest

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.posterior.scenes import OBJECT, sensor_of

RANGES = np.linspace(0.2, 1.5, 20)


def answer(truth: dict[str, Any], scene: dict[str, Any], seed: int) -> Posterior:
    sensor = sensor_of("pulsed", 96.5)
    path = SampledTrajectory(range_m=RANGES.tolist())
    frames = simulate(sensor, parse_scene({"object": OBJECT, **truth}), path, seed).frames
    exact = parse_scene({**scene, "discrepancy": 0})
    return infer(sensor, exact, frames, SamplerSettings(seed=1, method="auto"))


@pytest.mark.parametrize("seed", [4])
def test_crosstalk_that_the_spread_of_the_ranges_tells_is_weak(seed: int) -> None:
    """An object at constant speed: under the independent law draws alone hold no range."""
    crosstalk = np.random.default_rng(seed).normal(0.0, 0.01, 2).tolist()
    unknown = [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2
    scene = {"object": OBJECT, "crosstalk": unknown, "discrepancy": 0}
    law = {"prior": "loguniform", "low": 0.1, "high": 3.0}
    found = answer({"crosstalk": crosstalk}, {**scene, "range_m": law}, seed)
    inside = (found.range_m.q05 < RANGES) & (found.range_m.q95 > RANGES)
    # intervals reach where the reference prior would put them: the error is that shift, give or
    # take the sampling's own, and 1.6 standard deviations of the two are held
    assert inside.mean() > 0.9
    # the law is stated by the scene, whose model is exact
    parts = found.range_m.sd_parts
    assert (parts.scene / found.range_m.sd).min() > 0.5
    assert not parts.model.any()
    rows = {row.parameter: row for row in found.identifiability}
    for name in ("crosstalk.w2", "range_m"):
        assert rows[name].status == "weak"
        assert '"prior": "reference"' in rows[name].reason
    # moved by a random part of that shift: the quadrature of the stress suite knows nothing of it
    assert found.draws.widened
    law = {"prior": "reference", "low": 0.1, "high": 3.0}
    found = answer({"crosstalk": crosstalk}, {**scene, "range_m": law}, seed)
    inside = (found.range_m.q05 < RANGES) & (found.range_m.q95 > RANGES)
    # all ranges share the crosstalk: where it is within 1.6 standard deviations, most hold
    assert inside.mean() > 0.6
    assert not found.draws.widened


def test_an_object_at_rest_is_no_many_draws() -> None:
    """Twenty-six equal ranges of a moving scene: how many they are tells nothing of crosstalk.

    Two readings, crosstalk of two numbers and one range: the range stays as open as the prior of
    the crosstalk leaves it, which from one frame to twenty-six loses only the noise.
    """
    sensor = sensor_of("pulsed", 300.0)
    signal = 0.38  # w2 of the object there
    unknown = [{"prior": "normal", "mean": 0.0, "sd": 0.1 * signal * part} for part in (0.02, 1)]
    scene = parse_scene({"object": OBJECT, "crosstalk": unknown, "discrepancy": 0})
    made = parse_scene({"object": OBJECT, "crosstalk": [0.1 * signal * 0.02, 0.1 * signal]})
    width = {}
    for count in (1, 26):
        frames = simulate(sensor, made, SampledTrajectory(range_m=[0.4] * count), 2).frames
        found = infer(sensor, scene, frames, SamplerSettings(seed=1, method="auto"))
        ranges = found.range_m
        assert np.all((ranges.q05 < 0.4) & (ranges.q95 > 0.4))
        width[count] = float(np.median(ranges.q95 - ranges.q05))
    assert 0.8 < width[26] / width[1] < 1.25


def test_what_the_readings_themselves_tell_stays_identified() -> None:
    law = {"prior": "loguniform", "low": 0.05, "high": 3.0}
    found = answer({}, {"range_m": law}, 1)
    rows = {row.parameter: row.status for row in found.identifiability}
    assert not found.draws.widened
    assert rows["object.c0"] == rows["object.c2"] == rows["range_m"] == "identified"
