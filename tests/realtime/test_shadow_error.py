"""Errors of the shadow move roots as the same errors of the readings do, by finite differences."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.shadow_error import SHADOW_SD
from simulator.simulate import mean_readings

OBJECT = {"c0": 0.08, "c1": -0.03, "c2": 0.1}
SHADOW = {"c0": 0.06, "c1": 0.01}
WALL: dict[str, Any] = {"strength": 0.05, "distance_m": 2.5, "shadow": SHADOW}
R = np.array([0.3, 0.5, 0.8, 1.2])
SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 3e-8},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 1e7},
}
# the errors that stand by default where c0, c1 and c2 are numbers, but for the shadow's
OTHERS = {"flux": FITTED_SHARE * DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}
STEP = 1e-5


def sensor_of(kind: str) -> Sensor:
    return parse_sensor({**SENSORS[kind], "noise": {"read": [1e-9, 1e-9]}})


def readings_of(sensor: Sensor, wall: dict[str, Any]) -> np.ndarray:
    scene = parse_scene({"object": OBJECT, "background": wall})
    return mean_readings(sensor, parameters_of(sensor, scene).terms(np.zeros((1, 0))), R)


def answered(
    technique: str, sensor: Sensor, readings: np.ndarray, discrepancy: object = None
) -> TechniqueResult:
    scene: dict[str, Any] = {"object": OBJECT, "background": WALL}
    if discrepancy is not None:
        scene["discrepancy"] = discrepancy
    return estimate(sensor, parse_scene(scene), Frames(readings), [technique]).results[0]


@pytest.mark.parametrize("kind", sorted(SENSORS))
@pytest.mark.parametrize("technique", ["background_intensity", "background_cancelling"])
def test_the_part_of_the_shadow_is_what_its_errors_do(technique: str, kind: str) -> None:
    sensor = sensor_of(kind)
    readings = readings_of(sensor, WALL)
    whole = answered(technique, sensor, readings)
    others = answered(technique, sensor, readings, OTHERS)
    assert whole.sd_parts_m is not None
    assert others.sd_parts_m is not None
    share = R * (R + SHADOW["c1"]) / (R * (R + SHADOW["c1"]) + SHADOW["c0"])
    light = (1.0 - share) / np.sqrt(share)
    moves = []
    for part in ("strength", "distance_m"):
        more = readings_of(sensor, {**WALL, part: WALL[part] * (1.0 + STEP)})
        roots = answered(technique, sensor, more).roots_m
        move = np.nanmin(np.abs(roots - R[:, None]), axis=1) / STEP
        moves.append(move * (light if part == "strength" else 1.0 - share))
    expected = SHADOW_SD * np.hypot(*moves)
    one = whole.status == Status.UNIQUE
    assert one.sum() > 1
    found, rest = whole.sd_parts_m.model[one, 0], others.sd_parts_m.model[one, 0]
    # differences of first order: their own error is as the step
    np.testing.assert_allclose(np.hypot(rest, expected[one]), found, rtol=100 * STEP)


def test_an_exact_model_has_no_such_error() -> None:
    sensor = sensor_of("pulsed")
    exact = answered("background_intensity", sensor, readings_of(sensor, WALL), 0)
    assert exact.sd_parts_m is not None
    np.testing.assert_array_equal(exact.sd_parts_m.model, 0.0)
