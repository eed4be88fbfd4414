"""Unknowns that frames in the dark alone tell: what they say rests on where dark ranges lie."""

import numpy as np
import pytest

from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0805, "c1": 0.0307, "c2": 0.107}
READ = 2.9e-4
CROSSTALK = [-0.0028, 0.0004]


@pytest.mark.parametrize("empty", [0, 3])
def test_what_few_frames_in_the_dark_alone_tell_is_not_identified(empty: int) -> None:
    """Twelve frames of 48 read three times their noise; the others hardly tell crosstalk of w2.

    Called `identified`, it was 6 standard deviations off in a set of half as many, under a law of
    the ranges that had more mass in the dark. With empty frames it is told.
    """
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [READ, READ]}}
    )
    prior = {"prior": "normal", "mean": 0.0, "sd": 0.0044}
    ranges = np.repeat([0.477, 0.8085, 1.644, 0.3756], 12)
    path = SampledTrajectory(
        range_m=[1.0] * empty + ranges.tolist(), object_present=[False] * empty + [True] * 48
    )
    truth = parse_scene({"object": OBJECT, "crosstalk": CROSSTALK})
    frames = simulate(sensor, truth, path, np.random.default_rng(2)).frames
    told = parse_scene({"object": OBJECT, "crosstalk": [prior] * 2})
    found = infer(sensor, told, frames, SamplerSettings(method="auto", seed=1))
    row = {each.parameter: each for each in found.identifiability}["crosstalk.w2"]
    assert row.status == ("identified" if empty else "weak")
    assert ("in the dark" in row.reason) is not bool(empty)
