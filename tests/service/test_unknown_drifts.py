"""Temperature coefficients that are not known: who takes none says so, where, and what to do."""

import copy

import pytest

from inference.estimate import estimate
from inference.self_calibration.plan import plan_of
from inference.tracking.settings import TrackingSettings
from inference.tracking.tracker import tracker
from service.c_export import export_c
from service.problems import describe
from simulator.errors import RefusedError
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

DRIFT = {"prior": "normal", "mean": 0.0, "sd": 1e-3}
SENSOR = parse_sensor(
    {
        "kind": "pulsed",
        "pulse_width_s": 1e-7,
        "noise": {"read": [8e-5, 8e-5]},
        "temperature": {"gain_drift_per_k": DRIFT},
    }
)
SCENE = parse_scene({"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}})
OPEN = parse_scene({"crosstalk": [1e-3, {"prior": "halfnormal", "sd": 0.02}]})
SETTINGS = TrackingSettings(rate_sd=0.5)
GAIN = "/sensor/temperature/gain_drift_per_k"


@pytest.mark.parametrize(
    ("ask", "pointer", "remedy"),
    [
        (lambda: tracker(SENSOR, SCENE, SETTINGS), GAIN, "state the median of a posterior"),
        (lambda: plan_of(SENSOR, OPEN, SETTINGS, 1), GAIN, "calibrate from recorded frames"),
        (lambda: export_c("conventional", SENSOR, SCENE), GAIN.rpartition("/")[0], "turn the"),
    ],
)
def test_a_refusal_points_to_the_coefficient(ask: object, pointer: str, remedy: str) -> None:
    assert callable(ask)
    with pytest.raises(RefusedError) as refused:
        ask()
    # copied as on the way between processes
    for error in (refused.value, copy.copy(refused.value)):
        told = describe(error)
        assert [item["pointer"] for item in told["errors"]] == [pointer]
        assert told["status"] == 422
        assert remedy in told["detail"]


def test_estimates_leave_out_what_needs_a_number_and_say_so() -> None:
    columns = {"w1": [0.0014] * 4, "w2": [0.0314] * 4, "temperature_k": [300.0] * 4}
    frames = frames_from_columns(SENSOR, columns)
    found = estimate(SENSOR, SCENE, frames)
    reasons = {entry.name: entry.reason for entry in found.left_out}
    for name in ("intensity", "joint_fit"):
        assert "sensor.temperature.gain_drift_per_k as known numbers" in reasons[name]
        assert "a posterior" in reasons[name]
