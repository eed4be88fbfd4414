"""Estimates and tracks of sensors that follow their temperature."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status
from inference.temperature import UNKNOWN_TEMPERATURE
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from service.c_export import export_c
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.joint_scene import centre
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

NOISE = {"read": [1e-9, 1e-9]}
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 4e-8, "noise": NOISE},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6, "noise": NOISE},
}
DRIFTS = {"gain_drift_per_k": -3e-3, "delay_drift_s_per_k": 2e-11}
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SCENE: dict[str, Any] = {"object": OBJECT, "crosstalk": [0.01, 0.02], "discrepancy": 0}
RANGES = np.linspace(0.3, 1.5, 20)
KELVIN = np.linspace(280.0, 330.0, 20)
SINGLE = ["conventional", "intensity"]


def _seen(kind: str, **temperature: Any) -> tuple[Sensor, Frames]:
    sensor = parse_sensor(KINDS[kind] | {"temperature": DRIFTS | temperature})
    path = SampledTrajectory(
        range_m=RANGES.tolist(),
        time_s=(0.05 * np.arange(20)).tolist(),
        temperature_k=KELVIN.tolist(),
    )
    return sensor, simulate(sensor, parse_scene(SCENE), path, 1).frames


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_known_drifts_are_taken_off(kind: str) -> None:
    """To 6 of the stated standard deviations: by chance in 4e-8 of sets of 20."""
    sensor, frames = _seen(kind)
    for found in estimate(sensor, parse_scene(SCENE), frames, SINGLE).results:
        assert (found.status == Status.UNIQUE).all()
        assert (np.abs(found.range_m - RANGES) < 6 * found.sd_m).all()
    followed = track(sensor, parse_scene(SCENE), frames)
    assert (followed.status == Status.UNIQUE).all()
    assert (np.abs(followed.best_m - RANGES) < 6 * followed.best_sd_m).all()
    # what it would be without: centimetres and more
    bare = parse_sensor(KINDS[kind])
    (found,) = estimate(bare, parse_scene(SCENE), frames, ["intensity"]).results
    assert np.abs(found.range_m - RANGES).max() > 1e-2


def test_a_frame_of_unknown_temperature_has_no_range() -> None:
    sensor, frames = _seen("pulsed")
    kelvin = KELVIN.copy()
    kelvin[7] = np.nan
    frames, scene = dataclasses.replace(frames, temperature_k=kelvin), parse_scene(SCENE)
    (found,) = estimate(sensor, scene, frames, ["conventional"]).results
    others = np.arange(20) != 7
    assert found.status[7] == Status.NONE
    assert found.reasons[found.reason[7]] == UNKNOWN_TEMPERATURE
    assert np.isnan(found.range_m[7])
    assert (np.abs(found.range_m - RANGES)[others] < 6 * found.sd_m[others]).all()
    followed = track(sensor, scene, frames)
    assert followed.status[7] == Status.NONE
    assert (followed.status[others] == Status.UNIQUE).all()
    # the prediction knows what it does not know
    assert abs(followed.best_m[7] - RANGES[7]) < 5 * followed.best_sd_m[7]
    assert followed.best_sd_m[7] > 100 * followed.best_sd_m[6]
    untold = dataclasses.replace(frames, temperature_k=np.full(20, np.nan))
    (left,) = (
        row
        for row in estimate(sensor, scene, untold, ["conventional"]).left_out
        if row.name == "conventional"
    )
    assert "temperature_k is null" in left.reason


def test_a_track_does_not_depend_on_how_it_is_cut() -> None:
    sensor, frames = _seen("sine_wave")
    model = tracker(sensor, parse_scene(SCENE))
    whole, state = step(model, model.first, frames)[1], model.first
    for k in range(20):
        state, one = step(model, state, frames.select(slice(k, k + 1)))
        assert one.best_m[0] == whole.best_m[k]


def test_what_is_not_known_is_left_out_by_name() -> None:
    prior = {"prior": "normal", "mean": 0.0, "sd": 1e-11}
    sensor, frames = _seen("pulsed", delay_drift_s_per_k=prior)
    found = estimate(sensor, parse_scene(SCENE), frames, [*SINGLE, "object_fit"])
    assert [result.technique for result in found.results] == ["intensity"]
    reasons = {row.name: row.reason for row in found.left_out}
    assert "sensor.temperature.delay_drift_s_per_k" in reasons["conventional"]
    with pytest.raises(RefusedError, match="delay_drift_s_per_k unknown"):
        tracker(sensor, parse_scene(SCENE))
    with pytest.raises(RefusedError, match="export to C knows no temperature"):
        export_c("conventional", sensor, parse_scene(SCENE))
    known, frames = _seen("pulsed")
    unknown = parse_scene(SCENE | {"crosstalk": [prior, prior]})
    with pytest.raises(RefusedError, match="could not take them apart"):
        tracker(known, unknown)
    reasons = {row.name: row.reason for row in estimate(known, unknown, frames).left_out}
    assert "follows its temperature" in reasons["differential"]


def test_a_joint_law_of_drifts_is_a_part_of_every_error() -> None:
    prior = {"prior": "normal", "mean": -3e-3, "sd": 1e-4}
    sensor, frames = _seen("pulsed", gain_drift_per_k=prior)
    law = {
        "unknowns": ["sensor.temperature.gain_drift_per_k"],
        "modes": [{"weight": 1.0, "mean": [0.0], "covariance": [[1.0]]}],
    }
    scene = parse_scene(SCENE | {"joint": law})
    of, _ = centre(sensor, scene)
    assert of.temperature is not None
    assert of.temperature.known == pytest.approx((-3e-3, 2e-11))
    (found,) = estimate(sensor, scene, frames, ["intensity"]).results
    assert found.sd_parts_m is not None
    # Phi ~ r^b: a relative error e of the gain moves a range by e r / |b|
    c0, c1 = OBJECT["c0"], OBJECT["c1"]
    b = -2 - RANGES * (2 * RANGES + c1) / (RANGES**2 + c1 * RANGES + c0)
    warm = KELVIN - 298.15
    wanted = np.abs(1e-4 * warm / (1 - 3e-3 * warm)) * RANGES / np.abs(b)
    assert found.sd_parts_m.scene[:, 0] == pytest.approx(wanted, rel=1e-3)


def test_a_fit_of_a_calibrated_scene_takes_known_drifts_off() -> None:
    """The sensor at its reference is the one that the scene was calibrated with.

    To 6 of the stated standard deviations: by chance in 4e-8 of sets of 20.
    """
    sensor, frames = _seen("pulsed")
    width = {"prior": "lognormal", "median": OBJECT["c2"], "sigma": 0.1}
    law = {"unknowns": ["object.c2"], "modes": [{"mean": [0.0], "covariance": [[1e-4]]}]}
    calibration = {
        "sensor": sensor.model_dump(mode="json"),
        "converged": True,
        "misfit": False,
        "frames": {"count": 20, "sha256": "0" * 64},
        "model_error": [0.0, 0.0],
        "unknowns": [],
    }
    stated = SCENE | {"object": OBJECT | {"c2": width}, "joint": law, "calibration": calibration}
    (found,) = estimate(sensor, parse_scene(stated), frames, ["joint_fit"]).results
    assert (found.status == Status.UNIQUE).all()
    assert (np.abs(found.range_m - RANGES) < 6 * found.sd_m).all()


def test_a_column_without_coefficients_is_told() -> None:
    _, frames = _seen("pulsed")
    found = estimate(parse_sensor(KINDS["pulsed"]), parse_scene(SCENE), frames)
    assert "temperature_k is given and not used" in found.assumptions[0]
