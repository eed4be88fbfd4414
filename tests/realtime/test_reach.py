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
from inference.realtime.net import Net
from inference.realtime.phase_reach import phase_reach
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import SineWaveSensor, parse_sensor
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
    # before a wall noise reaches it from most of them
    assert told.sum() > n / (6 if name == "background_intensity" else 4)
    assert (off[told] > BAND).sum() <= binom.isf(1e-7, n, 2 * BEYOND)
    assert (off[told] < 1.6449).mean() > 0.85


def test_a_phase_is_any_where_noise_is_as_long_as_the_light() -> None:
    phase = np.array([0.3, 0.3, 0.3])
    sd = np.array([0.01, 0.2, 0.4])
    told = phase_reach(phase, sd, phasor(phase, sd, sd), np.ones(3), 2 * math.pi)
    assert told == pytest.approx([0.01, math.asin(0.6) / 3, (2 * math.pi - 0.3) / 3])


def phasor(phase: Array, across: Array, along: Array, both: float = 0.0) -> Net:
    """Return phasors of length 1, with noise across and along them, and its covariance."""
    c, s = np.cos(phase), np.sin(phase)
    return Net(
        c,
        s,
        (along * c) ** 2 + (across * s) ** 2 - 2 * both * c * s,
        (along * s) ** 2 + (across * c) ** 2 + 2 * both * c * s,
        (along**2 - across**2) * c * s + both * (c**2 - s**2),
        0.0,
        np.zeros(phase.size, np.uint8),
    )


@pytest.mark.parametrize("both", [-0.006, 0.0, 0.006])
def test_a_phase_reaches_to_the_tangents_of_its_noise(both: float) -> None:
    """Noise that is larger along the phasor than across, against the ellipse of three of it."""
    phase, across, along = np.array([0.3]), np.array([0.04]), np.array([0.3])
    net = phasor(phase, across, along, both)
    told = phase_reach(phase, across, net, np.ones(1), 2 * math.pi)
    root = np.linalg.cholesky([[net.var1[0], net.cov[0]], [net.cov[0], net.var2[0]]])
    t = np.linspace(0.0, 2 * math.pi, 100_001)
    ends = np.array([[net.first[0]], [net.second[0]]]) + BAND * root @ [np.cos(t), np.sin(t)]
    reached = np.abs(np.angle(np.exp(1j * (np.arctan2(ends[1], ends[0]) - 0.3)))).max()
    assert told[0] == pytest.approx(reached / BAND, rel=1e-6)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.0])
@pytest.mark.parametrize("length", [2.0, 8.0])
def test_photons_of_a_bright_glass_hide_which_way_a_faint_phasor_points(
    angle: float, length: float
) -> None:
    """Noise of the crosstalk's photons is ten times as large in i as in q.

    5 to 29 % of such frames were more than five standard deviations off. At most 0.27 % may be
    beyond three, and of two readings twice as many; a false alarm once in 1e7 runs of each.
    """
    n, far = 4000, np.array([1e4, 5e2])
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1.0, 1.0], "shot": 1e-2}}
    )
    assert isinstance(sensor, SineWaveSensor)
    mean = far + length * np.array([math.cos(angle), math.sin(angle)])
    noise = np.random.default_rng(20261124).normal(size=(n, 2)) * np.sqrt(1.0 + 1e-2 * mean)
    scene = parse_scene({"crosstalk": far.tolist()})
    (result,) = estimate(sensor, scene, Frames(mean + noise), ["conventional"]).results
    off = np.abs(result.range_m - angle / sensor.wave_number) / result.sd_m
    told = np.isfinite(off)
    assert told.sum() > n / 4
    assert (off[told] > BAND).sum() <= binom.isf(1e-7, n, 2 * BEYOND)
