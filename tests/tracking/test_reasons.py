"""Why a frame of a track has no range, in words."""

import json
from typing import Any

import numpy as np

from inference.estimates import Status
from inference.tracking.reasons import REASONS, reason_codes
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step
from inference.tracking.tracker import Tracker, tracker
from service.messages import MESSAGES
from service.messages.streaming import limits_of_tracker, line_as_message
from service.streams.answered import text_of
from service.streams.lines import lines_in
from service.streams.said import said_of
from simulator.frames import Frames, frames_from_columns
from simulator.parameters import parameters_of
from simulator.simulate import mean_readings
from tests.tracking.scenes import PLATE, scene_of, sensor_of

NOISE, RANGE_M = 8e-5, 0.7
EMPTY, HIDDEN, OUTLIER, UNKNOWN, UNTOLD = REASONS[1:]


def model_of(**more: Any) -> Tracker:
    return tracker(sensor_of(NOISE), scene_of(PLATE, **more), TrackingSettings(visit_s=5.0))


def columns(count: int) -> dict[str, list[Any]]:
    """Return frames of an object at rest, without noise."""
    sensor, scene = sensor_of(NOISE), scene_of(PLATE)
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    one = mean_readings(sensor, terms, np.array([RANGE_M]))[0].tolist()
    times = (0.02 * np.arange(count)).tolist()
    return {"time_s": times, "w1": [one[0]] * count, "w2": [one[1]] * count}


def lines_of(model: Tracker, frames: Frames) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the reasons of a track, and the lines of a stream of the same frames."""
    _, found = step(model, model.first, frames)
    count = len(found)
    assert frames.time_s is not None
    said = said_of(found, range(count), frames.time_s, np.zeros(count))
    return found.reasons, [json.loads(line) for line in lines_in(text_of(said))]


def checked(model: Tracker, columns: dict[str, list[Any]], status: Status, reason: str) -> None:
    """Check the last frame, in the track, in the stream's line and beside every message."""
    frames = frames_from_columns(model.sensor, columns)
    reasons, lines = lines_of(model, frames)
    assert lines[-1]["status"] == status.name.lower()
    assert reasons[-1] == reason
    assert lines[-1].get("reason", "") == reason
    for line, told in zip(lines, reasons, strict=True):
        assert ("reason" in line) == (line["status"] == "none") == bool(told)
        for message in MESSAGES:
            written = line_as_message(message, limits_of_tracker(model), json.dumps(line).encode())
            assert json.loads(written).get("reason", "") == told


def test_a_range_needs_no_reason() -> None:
    checked(model_of(), columns(5), Status.UNIQUE, "")


def test_an_empty_scene() -> None:
    seen = columns(5)
    seen["w1"][-1] = seen["w2"][-1] = 0.0
    checked(model_of(), seen, Status.NONE, EMPTY)
    stated = columns(5) | {"object_present": [True] * 4 + [False]}
    checked(model_of(), stated, Status.NONE, EMPTY)


def test_an_outlier_of_an_empty_scene() -> None:
    seen = columns(5)
    for name, odd in (("w1", -0.3), ("w2", 0.2)):
        seen[name] = [0.0] * 4 + [odd]
    checked(model_of(), seen, Status.NONE, OUTLIER)


def test_an_object_at_rest_beside_crosstalk_that_may_be_its_own() -> None:
    prior = {"prior": "normal", "mean": 0.0, "sd": 0.03}
    checked(model_of(crosstalk=[prior, prior]), columns(3), Status.NONE, HIDDEN)


def test_a_frame_without_its_temperature() -> None:
    follows = {"reference_k": 293.0, "gain_drift_per_k": 0.001}
    model = tracker(sensor_of(NOISE, temperature=follows), scene_of(PLATE))
    seen = columns(5) | {"temperature_k": [293.0] * 4 + [None]}
    checked(model, seen, Status.NONE, UNTOLD)


def test_an_object_that_is_there_without_a_range() -> None:
    status, none = np.array([Status.NONE], dtype=np.uint8), np.zeros(1)
    code = reason_codes(status, np.array([0.7]), none, np.zeros(1, dtype=np.uint8))
    assert REASONS[code[0]] == UNKNOWN
