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
from simulator.sensor import Sensor, SineWaveSensor, parse_sensor
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


@pytest.mark.parametrize("turns", [0.8, 1.4, 3.3])
@pytest.mark.parametrize("size", [-2.0, -1.0, 1.0, 2.0])
def test_no_root_that_the_shadow_moves_or_merges_is_taken_away(turns: float, size: float) -> None:
    """A wall whose visible light is farther or nearer than stated by some standard deviations.

    Of a wall so many half turns of phase away there are several roots; an error of the shadow that
    merges the right one with another leaves a third, which must not be called the only one.
    """
    sensor = sensor_of("sine_wave")
    assert isinstance(sensor, SineWaveSensor)
    distance = turns * np.pi / sensor.wave_number
    grid = np.geomspace(0.2, min(3.0, 0.7 * distance), 60)
    share = grid * (grid + SHADOW["c1"]) / (grid * (grid + SHADOW["c1"]) + SHADOW["c0"])
    wall = {"strength": 0.05, "distance_m": distance, "shadow": SHADOW}
    readings = []
    for r, hidden in zip(grid, 1.0 - share, strict=True):
        moved = {**wall, "distance_m": distance * (1.0 + size * SHADOW_SD * hidden)}
        scene = parse_scene({"object": OBJECT, "background": moved})
        terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
        readings.append(mean_readings(sensor, terms, np.array([r]))[0])
    said = estimate(
        sensor,
        parse_scene({"object": OBJECT, "background": wall}),
        Frames(np.array(readings)),
        ["background_cancelling"],
    ).results[0]
    sure = (said.status == Status.UNIQUE) & ~said.near_fold
    off = np.abs(said.range_m - grid)[sure] / said.sd_m[sure]
    assert off.max() < 1.5 * abs(size) + 0.5  # of first order
    kept = (np.abs(said.roots_m - grid[:, None]) < 4 * said.roots_sd_m).any(axis=1)
    assert (kept | said.near_fold | (said.status == Status.NONE)).all()
    assert (said.status != Status.NONE).mean() > 0.4
