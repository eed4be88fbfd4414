"""Standard deviations of frames that nearly drown hold as far as three of the noise's."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import binom

from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.realtime.phase_reach import phase_reach
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import mean_readings

Array = NDArray[np.float64]

BAND = 3.0
BEYOND = 2 * 0.5 * math.erfc(BAND / math.sqrt(2))  # of a normal law, 0.27 %
PLATE = {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}
WALL = {"distance_m": 3.0, "strength": 0.0177, "shadow": {"c0": 0.056, "c1": 0.013}}
UNKNOWN = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
SCENES: dict[str, dict[str, Any]] = {
    "conventional": {},
    "intensity": {"object": PLATE},
    "intensity_w1": {"object": PLATE},
    "background_cancelling": {"object": PLATE, "background": {**WALL, "strength": UNKNOWN}},
    "background_intensity": {"object": PLATE, "background": WALL},
}


def sensor_document(kind: str, read: float) -> dict[str, Any]:
    noise = {"read": [read, read]}
    if kind == "pulsed":
        return {"kind": kind, "pulse_width_s": 1e-7, "noise": noise}
    return {"kind": kind, "frequency_hz": 2e7, "noise": noise}


def answered(kind: str, name: str, ranges: Array, read: float, seed: int | None) -> TechniqueResult:
    sensor = parse_sensor(sensor_document(kind, read))
    truth: dict[str, Any] = {"object": PLATE}
    if name.startswith("background"):
        truth["background"] = WALL
    terms = parameters_of(sensor, parse_scene(truth)).terms(np.zeros((1, 0)))
    readings = mean_readings(sensor, terms, ranges)
    if seed is not None:
        readings = readings + read * np.random.default_rng(seed).normal(size=readings.shape)
    scene = parse_scene({**SCENES[name], "discrepancy": 0})
    return estimate(sensor, scene, Frames(readings), [name]).results[0]


def light(r: float) -> float:
    return PLATE["c0"] * PLATE["c2"] / (r * r * (r * r + PLATE["c1"] * r + PLATE["c0"]))


@pytest.mark.parametrize("times", [3.2, 5.0, 30.0])
def test_the_standard_deviation_is_the_farther_end_of_the_band(times: float) -> None:
    """Against the ends found by themselves, of readings some times their noise."""
    r = 1.3
    read = light(r) / times
    result = answered("pulsed", "intensity", np.array([r]), read, None)
    ends = [
        brentq(lambda x, at=at: light(x) - at, 1e-3, 1e3, xtol=1e-14)
        for at in (light(r) + BAND * read, light(r) - BAND * read)
    ]
    expected = max(abs(end - r) for end in ends) / BAND
    assert result.sd_m[0] == pytest.approx(expected, rel=1e-9)


def test_where_little_noise_is_left_the_tangent_holds() -> None:
    r, read = 1.3, light(1.3) * 1e-3
    slope = (light(r * (1 + 1e-5)) - light(r * (1 - 1e-5))) / (2e-5 * r)
    result = answered("pulsed", "intensity", np.array([r]), read, None)
    assert result.sd_m[0] == pytest.approx(read / abs(slope), rel=1e-8)


def test_light_that_noise_can_make_of_none_says_so() -> None:
    """Nothing bounds its range from above; where the scene does, that is the standard deviation."""
    r = 1.3
    read = light(r) / 2.5
    result = answered("pulsed", "intensity", np.array([r]), read, None)
    assert result.range_m[0] == pytest.approx(r, rel=1e-9)
    assert math.isnan(result.sd_m[0])
    assert "any farther range" in result.reasons[result.reason[0]]
    sensor = parse_sensor(sensor_document("pulsed", read))
    stated = {"object": PLATE, "discrepancy": 0}
    stated["range_m"] = {"prior": "reference", "low": 0.1, "high": 4.0}
    frames = Frames(np.array([[0.0, light(r)]]))
    bounded = estimate(sensor, parse_scene(stated), frames, ["intensity"]).results[0]
    assert bounded.sd_m[0] == pytest.approx((4.0 - r) / BAND, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "kind"),
    [(name, "pulsed") for name in SCENES]
    # a sine wave has no late window
    + [(name, "sine_wave") for name in SCENES if name != "intensity_w1"],
)
def test_answers_in_the_dark_are_not_far_off(kind: str, name: str) -> None:
    """Ranges from where light is 30 times its noise to where there is next to none.

    Of one reading an answer is beyond 3 sd if noise is, in 0.27 % of the frames that are asked
    for: those of no light that are told are told by such noise. Two independent readings, and a
    phase, count twice. A false alarm once in 1e6 runs of all.
    """
    n = 4000
    ranges = np.geomspace(0.3, 2.6, n)
    result = answered(kind, name, ranges, light(0.6) / 30, seed=20261123)
    off = np.abs(result.range_m - ranges) / result.sd_m
    told = np.isfinite(off) & ~result.near_fold
    assert told.sum() > n / 4
    assert (off[told] > BAND).sum() <= binom.isf(1e-7, n, 2 * BEYOND)
    assert (off[told] < 1.6449).mean() > 0.85


def test_a_phase_is_any_where_noise_is_as_long_as_the_light() -> None:
    phase = np.array([0.3, 0.3, 0.3])
    sd = np.array([0.01, 0.2, 0.4])
    told = phase_reach(phase, sd, 2 * math.pi)
    assert told == pytest.approx([0.01, math.asin(0.6) / 3, (2 * math.pi - 0.3) / 3])
