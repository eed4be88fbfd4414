"""Light that may be the error of an empty scene, in all frames the same, is no object's."""

from typing import Any

import numpy as np
import pytest

from inference.estimates import Status
from inference.tracking.track import Track, track
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS, OBJECT
from tests.tracking.scenes import PLATE, frames_of, sensor_of

NOISE, FRAMES = 1e-5, 900
CROSSTALK = np.array([0.3, 0.6])
DIRECTION = np.array([np.cos(0.8), np.sin(0.8)])


def tracked(kind: str, scene: dict[str, Any], light: Any) -> Track:
    rng = np.random.default_rng(1)
    readings = CROSSTALK + light + NOISE * rng.standard_normal((FRAMES, 2))
    stated = parse_scene({"crosstalk": CROSSTALK.tolist(), **scene})
    return track(sensor_of(NOISE, kind), stated, frames_of(readings, 1 / 30))


def answered(track: Track) -> float:
    return float((track.status == Status.UNIQUE).mean())


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_crosstalk_off_by_three_of_its_errors_is_no_object_in_any_number_of_frames(
    kind: str,
) -> None:
    found = tracked(kind, {"object": OBJECT}, 0.6 * NOISE * DIRECTION)
    # at the limit of 3 errors noise beside the offset passes for more now and then
    assert answered(found) < 0.05
    assert found.present.mean() < 0.25
    assert answered(tracked(kind, PLATE, 0.6 * NOISE * DIRECTION)) == 0.0


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_crosstalk_off_by_two_errors_of_a_joint_law_is_no_object(kind: str) -> None:
    columns = sensor_of(NOISE, kind).columns
    sd = 0.7 * NOISE
    law = {
        "unknowns": [f"crosstalk.{name}" for name in columns],
        "modes": [{"mean": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}],
    }
    priors = [{"prior": "normal", "mean": mean, "sd": sd} for mean in CROSSTALK]
    scene = {"object": OBJECT, "crosstalk": priors, "joint": law}
    assert answered(tracked(kind, scene, 2.0 * sd * DIRECTION)) < 0.02


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_faint_object_beyond_the_error_of_the_empty_scene_is_found(kind: str) -> None:
    terms = parameters_of(sensor_of(NOISE, kind), parse_scene({"object": OBJECT}))
    ranges = 3.5 * np.exp(0.1 * np.sin(1.5 * np.arange(FRAMES) / 30))
    light = mean_readings(sensor_of(NOISE, kind), terms.terms(np.zeros((1, 0))), ranges)
    found = tracked(kind, {"object": OBJECT}, light)
    # three to eight times the noise of a frame
    assert 3.0 < np.hypot(*light.T).min() / NOISE < np.hypot(*light.T).max() / NOISE < 8.5
    assert answered(found) > 0.97
    # 90 % intervals, of some 150 ranges that noise makes independent: 4 sd
    off = np.abs(found.best_m - ranges) / found.best_sd_m
    assert (off[found.status == Status.UNIQUE] < 1.645).mean() > 0.8
