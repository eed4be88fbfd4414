"""Learnt crosstalk that is far from its prior: the motion was not as stated, and that is said."""

import math
from typing import Any

import numpy as np
import pytest

from benchmarks.random_sets.sets import random_set
from inference.tracking.first_state import crosstalk_bounds
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.scene import parse_scene

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}


@pytest.mark.parametrize(
    ("seed", "number", "told"), [(11, 259, 0.5), (12, 515, 0.5), (20261125, 681, 0.4)]
)
def test_objects_that_jump_are_not_confident_and_wrong(seed: int, number: int, told: float) -> None:
    data = random_set(seed, number)
    found = track(data.sensor, parse_scene(data.scene), data.frames)
    off = np.abs(found.range_m - data.range_m) / found.sd_m
    # 6 to 8 frames each were 7 to 11 sd off, and nothing said so; since a step may be a turn
    # none is off
    assert np.isfinite(off).mean() > told
    assert found.misfit[off > 5.0].all()


@pytest.mark.parametrize(
    ("prior", "low", "high"),
    [
        ({"prior": "normal", "mean": 1.0, "sd": 0.5}, -1.0, 3.0),
        # as far as either goes: the law, or the normal law with its moments
        ({"prior": "uniform", "low": 0.0, "high": 1.0}, 0.5 - 4 / 12**0.5, 0.5 + 4 / 12**0.5),
        (
            {"prior": "halfnormal", "sd": 1.0},
            (2 / math.pi) ** 0.5 - 4 * (1 - 2 / math.pi) ** 0.5,
            4.161,  # half of the tail that a normal law has beyond 4
        ),
    ],
)
def test_bounds_are_those_of_the_prior(prior: dict[str, Any], low: float, high: float) -> None:
    scene = parse_scene({"object": OBJECT, "crosstalk": [prior, 0.0]})
    bounds = crosstalk_bounds(scene, TrackingSettings(), (True, False))
    assert bounds is not None
    assert bounds[0] == pytest.approx([low, high], rel=1e-3)
    assert bounds[1].tolist() == [-math.inf, math.inf]


def test_crosstalk_that_may_drift_has_no_bounds() -> None:
    prior = {"prior": "normal", "mean": 0.0, "sd": 1.0}
    scene = parse_scene({"object": OBJECT, "crosstalk": [prior, prior]})
    drifts = TrackingSettings(crosstalk_drift=(0.1, 0.1))
    assert crosstalk_bounds(scene, drifts, (True, True)) is None
