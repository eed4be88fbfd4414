"""Sensors with a timing offset, and sensors that are not calibrated, in techniques at once."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.plan import plan
from inference.realtime.net import net_readings
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
WALL = {"strength": 0.03, "distance_m": 2.5, "shadow": {"c0": 0.06, "c1": 0.01}}
NOISE = {"read": [1e-6, 2e-6], "shot": 1e-7}
PULSE = {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": NOISE}
WAVE = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE}
RANGES = np.linspace(0.4, 1.6, 9)
SD_S, SD_RAD = 1e-11, 4e-3


def _frames(sensor: Sensor, document: dict[str, Any]) -> Frames:
    scene = parse_scene(document)
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    return Frames(mean_readings(sensor, terms, RANGES), time_s=np.arange(9.0))


@pytest.mark.parametrize("offset", [-1e-9, 2e-10, 3e-9])
@pytest.mark.parametrize(
    ("technique", "document"),
    [
        ("conventional", {"crosstalk": [1e-3, 2e-3]}),
        ("intensity", {}),
        ("intensity_w1", {}),
        ("background_cancelling", {"background": WALL}),
        ("background_intensity", {"background": WALL, "crosstalk": [1e-3, 2e-3]}),
    ],
)
def test_a_known_timing_offset_is_taken_off(
    technique: str, document: dict[str, Any], offset: float
) -> None:
    """Readings without noise lead back to the range, to what rounding of them does."""
    sensor = parse_sensor(PULSE | {"timing_offset_s": offset})
    stated = {"object": OBJECT, "discrepancy": 0, **document}
    found = estimate(sensor, parse_scene(stated), _frames(sensor, stated), [technique])
    (result,) = found.results
    off = np.nanmin(np.abs(result.roots_m - RANGES[:, None]), axis=1)
    assert off == pytest.approx(np.zeros(9), abs=1e-9)


def test_derivatives_of_a_pulse_with_a_timing_offset() -> None:
    """The derivatives that a sensor measures, by differences of 1e-6 m: to 1e-6 of the range."""
    sensor = parse_sensor(
        PULSE | {"timing_offset_s": 2e-9, "noise": NOISE | {"derivative": [1e-6, 1e-6]}}
    )
    document = {"object": OBJECT, "discrepancy": 0, "crosstalk": [0.2, 0.3]}
    scene, step = parse_scene(document), 1e-6
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    up, down = (mean_readings(sensor, terms, RANGES + h) for h in (step, -step))
    frames = Frames(_frames(sensor, document).readings, derivatives=(up - down) / (2 * step))
    unknown = parse_scene(document | {"crosstalk": [{"prior": "halfnormal", "sd": 1.0}] * 2})
    (result,) = estimate(sensor, unknown, frames, ["differential"]).results
    off = np.nanmin(np.abs(result.roots_m - RANGES[:, None]), axis=1)
    assert off == pytest.approx(np.zeros(9), abs=1e-6)


def test_noise_of_readings_on_time_is_that_of_their_linear_form() -> None:
    readings = np.array([[0.3, 0.9], [0.01, 0.4]])
    plain = net_readings(parse_sensor(PULSE), (0.0, 0.0), Frames(readings))
    sensor = parse_sensor(PULSE | {"timing_offset_s": 3e-9})
    found = net_readings(sensor, (0.0, 0.0), Frames(readings))
    form = np.array([[1.0, -3e-9 / 3e-8], [0.0, 1.0]])
    for k in range(2):
        before = [[plain.var1[k], plain.cov[k]], [plain.cov[k], plain.var2[k]]]
        after = [[found.var1[k], found.cov[k]], [found.cov[k], found.var2[k]]]
        assert np.allclose(after, form @ before @ form.T, rtol=1e-12, atol=0)
        assert np.allclose([found.first[k], found.second[k]], form @ readings[k], rtol=1e-14)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_a_calibrated_offset_is_a_shared_part_of_the_error(kind: str) -> None:
    """Half a centimetre of timing, or its phase, moves every range by as much: part ``scene``."""
    path, prior, shared = "sensor.timing_offset_s", 1e-10, 0.5 * SPEED_OF_LIGHT * SD_S
    document = PULSE | {"timing_offset_s": {"prior": "normal", "mean": 0.0, "sd": prior}}
    if kind == "sine_wave":
        path, prior = "sensor.phase_offset_rad", 0.1
        document = WAVE | {"phase_offset_rad": {"prior": "normal", "mean": 0.0, "sd": prior}}
        shared = SD_RAD / (4 * np.pi * 2e7 / SPEED_OF_LIGHT)
    sd = (SD_S if kind == "pulsed" else SD_RAD) / prior
    stated: dict[str, Any] = {"object": OBJECT, "discrepancy": 0}
    mode = {"mean": [0.0], "covariance": [[sd * sd]]}
    scene = parse_scene(stated | {"joint": {"unknowns": [path], "modes": [mode]}})
    sensor = parse_sensor(document)
    known = parse_sensor(document | {path.removeprefix("sensor."): 0.0})
    frames = _frames(known, stated)
    (result,) = estimate(sensor, scene, frames, ["conventional"]).results
    assert result.roots_m[:, 0] == pytest.approx(RANGES, rel=1e-9)
    assert result.sd_parts_m is not None
    assert result.sd_parts_m.scene[:, 0] == pytest.approx(np.full(9, shared), rel=1e-6)
    both = np.hypot(result.sd_parts_m.noise[:, 0], shared)
    assert result.roots_sd_m[:, 0] == pytest.approx(both, rel=1e-6)
    (of_flux,) = estimate(sensor, scene, frames, ["intensity"]).results
    assert of_flux.sd_parts_m is not None
    assert of_flux.sd_parts_m.scene[:, 0] == pytest.approx(np.zeros(9), abs=1e-12)
    tracked = track(sensor, scene, frames, TrackingSettings())
    alone = track(known, parse_scene(stated), frames, TrackingSettings())
    # flux and time of flight together know the range better than time of flight alone, not worse
    assert (tracked.sd_m[1:] <= 1.01 * np.hypot(alone.sd_m, shared)[1:]).all()
    assert (tracked.sd_m[1:] > alone.sd_m[1:]).all()


def test_w2_needs_no_timing() -> None:
    stated = {"object": OBJECT, "discrepancy": 0}
    sensor = parse_sensor(PULSE | {"timing_offset_s": {"prior": "normal", "mean": 0.0, "sd": 1e-9}})
    frames = _frames(parse_sensor(PULSE | {"timing_offset_s": 1e-9}), stated)
    found = estimate(sensor, parse_scene(stated), frames)
    assert found.chosen == "intensity"
    assert found.results[0].roots_m[:, 0] == pytest.approx(RANGES, rel=1e-9)


def test_an_unknown_offset_leaves_out_what_needs_it() -> None:
    phase = {"prior": "normal", "mean": 0.0, "sd": 0.1}
    gain = {"prior": "lognormal", "median": 1.0, "sigma": 0.1}
    scene = parse_scene({"object": OBJECT})
    made = plan(parse_sensor(WAVE | {"phase_offset_rad": phase}), scene)
    assert made.chosen == "intensity"
    reasons = {item.name: item.reason for item in made.left_out}
    for name in ("conventional", "differential"):
        assert "needs sensor.phase_offset_rad" in reasons[name]
    made = plan(parse_sensor(WAVE | {"gain": gain}), scene)
    assert made.chosen == "conventional"
    reasons = {item.name: item.reason for item in made.left_out}
    assert "needs sensor.gain" in reasons["intensity"]
    assert "sensor.gain" in reasons["joint_fit"]
    sensor = parse_sensor(WAVE | {"phase_offset_rad": phase})
    with pytest.raises(RefusedError, match=r"sensor\.phase_offset_rad"):
        track(sensor, scene, Frames(np.ones((2, 2)), time_s=np.arange(2.0)))
