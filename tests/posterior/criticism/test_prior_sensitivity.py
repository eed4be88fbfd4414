"""What rests on the law of the ranges is not called identified."""

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
    return infer(sensor, parse_scene(scene), frames, SamplerSettings(seed=1, max_seconds=60))


@pytest.mark.parametrize("seed", [4])
def test_crosstalk_that_the_spread_of_the_ranges_tells_is_weak(seed: int) -> None:
    """An object at constant speed: under the independent law no interval holds its range."""
    crosstalk = np.random.default_rng(seed).normal(0.0, 0.01, 2).tolist()
    unknown = [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2
    scene = {"object": OBJECT, "crosstalk": unknown}
    law = {"prior": "loguniform", "low": 0.1, "high": 3.0}
    found = answer({"crosstalk": crosstalk}, {**scene, "range_m": law}, seed)
    inside = (found.range_m.q05 < RANGES) & (found.range_m.q95 > RANGES)
    assert inside.mean() < 0.5
    rows = {row.parameter: row for row in found.identifiability}
    for name in ("crosstalk.w2", "range_m"):
        assert rows[name].status == "weak"
        assert '"prior": "reference"' in rows[name].reason
    law = {"prior": "reference", "low": 0.1, "high": 3.0}
    found = answer({"crosstalk": crosstalk}, {**scene, "range_m": law}, seed)
    inside = (found.range_m.q05 < RANGES) & (found.range_m.q95 > RANGES)
    # all ranges share the crosstalk: where it is within 1.6 standard deviations, most hold
    assert inside.mean() > 0.6


def test_what_the_readings_themselves_tell_stays_identified() -> None:
    law = {"prior": "loguniform", "low": 0.05, "high": 3.0}
    found = answer({}, {"range_m": law}, 1)
    rows = {row.parameter: row.status for row in found.identifiability}
    assert rows["object.c0"] == rows["object.c2"] == rows["range_m"] == "identified"
