"""What a joint law leaves open of a background is no reason to doubt the range before it."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

NOISE = {"read": [1e-6, 1e-6]}
SENSORS = {
    "pulsed": parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": NOISE}),
    "sine_wave": parse_sensor({"kind": "sine_wave", "frequency_hz": 1e7, "noise": NOISE}),
}
OBJECT = {"c0": 0.08, "c1": 0.05, "c2": 0.1}
SHADOW = {"c0": 0.06, "c1": 0.02}
STRENGTH, DISTANCE, SIGMA, LIGHT = 3e-3, 3.0, 0.01, 2e-5


def seen(
    kind: str, strength: float, second: float, ranges: tuple[float, float]
) -> tuple[Frames, NDArray[np.float64]]:
    """Readings of a moving object before a wall, and its ranges [m]."""
    wall = {"strength": strength, "distance_m": DISTANCE, "shadow": SHADOW}
    scene = {"object": OBJECT, "crosstalk": [0.0, second], "background": wall, "discrepancy": 0}
    path = RadialTrajectory(from_m=ranges[0], to_m=ranges[1], frames=40)
    made = simulate(SENSORS[kind], parse_scene(scene), path, 4)
    return made.frames, np.linspace(*ranges, 40)


def asked(kind: str, frames: Frames, median: float = STRENGTH) -> TechniqueResult:
    """What is said where a joint law has the wall's strength and the second column's crosstalk."""
    sensor: Sensor = SENSORS[kind]
    column = f"crosstalk.{sensor.columns[1]}"
    wall: dict[str, Any] = {
        "strength": {"prior": "lognormal", "median": median, "sigma": 1.0},
        "distance_m": DISTANCE,
        "shadow": SHADOW,
    }
    mode = {"mean": [0.0, 0.0], "covariance": [[(LIGHT / 0.1) ** 2, 0.0], [0.0, SIGMA**2]]}
    scene = {
        "object": OBJECT,
        "crosstalk": [0.0, {"prior": "normal", "mean": 0.0, "sd": 0.1}],
        "background": wall,
        "discrepancy": 0,
        "joint": {"unknowns": [column, "background.strength"], "modes": [mode]},
    }
    found = estimate(sensor, parse_scene(scene), frames, ["background_cancelling"])
    return found.results[0]


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(("of_strength", "of_light"), [(2.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_an_object_is_seen_whatever_the_law_leaves_open(
    kind: str, of_strength: float, of_light: float
) -> None:
    """Numbers one or two standard deviations off the law's centre: a range, and it is right."""
    strength = STRENGTH * np.exp(SIGMA * of_strength)
    frames, ranges = seen(kind, float(strength), LIGHT * of_light, (0.5, 1.9))
    result = asked(kind, frames)
    assert (result.status == Status.UNIQUE).all()
    told = np.isfinite(result.sd_m)
    assert told.sum() >= 25
    assert (np.abs(result.range_m - ranges)[told] < 4 * result.sd_m[told]).all()


@pytest.mark.parametrize("kind", SENSORS)
def test_a_wall_that_seems_to_be_below_zero_may_be_by_the_law(kind: str) -> None:
    """Crosstalk a standard deviation less than the law's centre takes all the light of the wall."""
    frames, ranges = seen(kind, LIGHT / 10, -LIGHT, (0.5, 1.2))
    result = asked(kind, frames, LIGHT / 10)
    assert (result.status == Status.UNIQUE).all()
    told = np.isfinite(result.sd_m)
    assert told.any()
    assert (np.abs(result.range_m - ranges)[told] < 4 * result.sd_m[told]).all()


@pytest.mark.parametrize("kind", SENSORS)
def test_a_background_far_beyond_the_law_is_none(kind: str) -> None:
    frames, _ = seen(kind, STRENGTH * 1.2, 0.0, (1.2, 1.9))
    assert (asked(kind, frames).status == Status.NONE).all()


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("of_light", [1.0, -1.0])
def test_light_that_may_be_crosstalk_has_no_error_bar_and_says_why(
    kind: str, of_light: float
) -> None:
    """An empty frame: the law's crosstalk alone explains it."""
    share = np.array([DISTANCE / SENSORS[kind].max_range_m, 1.0])
    if kind == "sine_wave":
        angle = 4 * np.pi * 1e7 / 299792458.0 * DISTANCE
        share = np.array([np.cos(angle), np.sin(angle)])
    empty = Frames(np.tile(STRENGTH * share + [0.0, of_light * LIGHT], (20, 1)))
    result = asked(kind, empty)
    assert np.isnan(result.sd_m).all()
    assert all(result.reasons[code] for code in result.reason)
