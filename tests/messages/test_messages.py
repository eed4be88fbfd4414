"""Ranges as messages of ROS 2 and MAVLink, read by what defines these."""

import json
import math
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from inference.estimate import estimate
from inference.fits.techniques.registry import FITS
from inference.realtime.registry import TECHNIQUES
from inference.tracking.tracker import tracker
from service.errors import NotAcceptableError
from service.exports.negotiation import accepted_type
from service.messages import MESSAGES
from service.messages.answering import encode_messages
from service.messages.measured import SIDES, Measured, total
from service.messages.streaming import (
    as_messages,
    limits_of_tracker,
    line_as_message,
    lines_type,
    message_for,
)
from service.streams.followers import Plain
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Line, Place
from service.streams.taking import take
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

ROS, MAVLINK = MESSAGES
SENSOR = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-5, 1e-3]}}
WAVE = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [5e-6, 5e-6]}}
TWO_ROOTS = {
    "object": {"c0": 0.0817, "c1": 0.0574, "c2": 0.103},
    "background": {
        "strength": {"prior": "lognormal", "median": 0.0075, "sigma": 0.3},
        "distance_m": 5.0, "shadow": {"c0": 0.0596, "c1": 0.0132},
    },
}  # fmt: skip

# https://docs.ros.org/en/jazzy/p/sensor_msgs/msg/Range.html, and std_msgs/Header
RANGE_FIELDS = {
    "header": dict, "radiation_type": int, "field_of_view": float, "min_range": float,
    "max_range": float, "range": float, "variance": float,
}  # fmt: skip

limits = st.tuples(st.floats(0.0, 1.0), st.sampled_from([1.0, 15.0, 700.0, math.inf]))
measured = st.builds(
    Measured,
    status=st.sampled_from(["unique", "ambiguous", "none", "saturated"]),
    range_m=st.none() | st.floats(1e-6, 1e6),
    variance_m2=st.none() | st.floats(1e-300, 1e300),
    side=st.sampled_from(["near", "far", None]),
    certain=st.booleans(),
    time_s=st.none() | st.floats(-1e9, 1e9),
    limits_m=limits,
).filter(lambda m: not m.certain or (m.range_m is not None and m.variance_m2 is not None))


def mavlink(fields: dict[str, Any]) -> Any:
    """Packed and parsed by pymavlink, as a client sends it and an autopilot reads it."""
    sender, reader = (common.MAVLink(None, srcSystem=1, srcComponent=2) for _ in range(2))
    reader.robust_parsing = False
    packet = common.MAVLink_distance_sensor_message(**fields).pack(sender)
    (message,) = reader.parse_buffer(packet)
    assert message.get_type() == "DISTANCE_SENSOR"
    for name, value in fields.items():
        assert getattr(message, name) == value
    return message


def ros(fields: dict[str, Any]) -> dict[str, Any]:
    """The message as a bridge makes it: numbers for what JSON does not have."""
    assert fields.keys() == {*RANGE_FIELDS, "rep117", "status"}
    stamp = fields["header"]["stamp"]
    assert isinstance(stamp["sec"], int)
    assert 0 <= stamp["nanosec"] < 10**9
    word = fields["rep117"]
    assert (fields["range"] is None) == (word in ("+inf", "-inf", "nan"))
    whole = dict(fields)
    whole["range"] = float(word) if fields["range"] is None else fields["range"]
    whole["max_range"] = math.inf if fields["max_range"] is None else fields["max_range"]
    for name, kind in RANGE_FIELDS.items():
        assert isinstance(whole[name], kind), name
    return whole


@given(measured=measured)
def test_every_answer_is_a_message(measured: Measured) -> None:
    """Fields that their systems read, and valid only what is certain."""
    body = json.loads(json.dumps([m.write(measured) for m in MESSAGES], allow_nan=False))
    reading, distance = ros(body[0]), mavlink(body[1])
    assert reading["variance"] == (measured.variance_m2 or 0.0)
    assert math.isfinite(reading["range"]) == measured.certain
    assert distance.signal_quality in (1, 100)
    assert distance.covariance >= 1
    if measured.variance_m2 is None:
        assert distance.covariance == 255
    elif distance.covariance < 255:
        assert distance.covariance >= 1e4 * measured.variance_m2 * (1 - 1e-12)
    inside = distance.min_distance <= distance.current_distance <= distance.max_distance
    assert inside == (distance.signal_quality == 100)
    if inside:
        assert measured.certain
        assert measured.range_m is not None
        assert abs(distance.current_distance - 100 * measured.range_m) <= 0.5


def messages_of(sensor: Any, scene: Any, columns: Any) -> tuple[list[Any], list[Any]]:
    parsed, world = parse_sensor(sensor), parse_scene(scene)
    frames = frames_from_columns(parsed, columns)
    found = estimate(parsed, world, frames)
    bodies = [json.loads(encode_messages(m, parsed, world, frames, found)) for m in MESSAGES]
    assert {body["technique"] for body in bodies} == {found.chosen}
    return [ros(m) for m in bodies[0]["messages"]], [mavlink(m) for m in bodies[1]["messages"]]


def test_one_range_too_near_none_and_saturated() -> None:
    sensor = SENSOR | {"full_scale": [1.0, 1.0]}
    columns = {
        "w1": [0.0242, 0.0, 0.006, 0.304, 2.0], "w2": [0.4230, 0.019, 0.021, 0.52, 2.0],
        "time_s": [0.0, 0.1, 0.2, 1.75, 3.0],
    }  # fmt: skip
    reading, distance = messages_of(sensor, {"crosstalk": [0.004, 0.02]}, columns)
    # 0.7513 m, sd 2.2 mm: 0.05 cm^2 and the rounding of the distance
    assert reading[0]["range"] == pytest.approx(0.7513, abs=5e-5)
    assert math.sqrt(reading[0]["variance"]) == pytest.approx(0.00216, rel=0.05)
    assert reading[0]["min_range"] == 0.0
    assert reading[0]["max_range"] == pytest.approx(14.99, abs=0.01)
    assert (distance[0].current_distance, distance[0].covariance) == (75, 1)
    assert distance[0].signal_quality == 100
    # no light, and late light beyond all light: nothing within reach
    assert [m["range"] for m in reading[1:3]] == [math.inf] * 2
    assert [m.current_distance for m in distance[1:3]] == [distance[0].max_distance + 1] * 2
    assert reading[3]["range"] == pytest.approx(8.994, abs=1e-3)
    assert reading[3]["header"]["stamp"] == {"sec": 1, "nanosec": 750_000_000}
    assert distance[3].time_boot_ms == 1750
    assert math.isnan(reading[4]["range"])
    assert reading[4]["status"] == "saturated"
    assert (distance[4].signal_quality, distance[4].covariance) == (1, 255)


def test_readings_that_noise_cannot_make_are_no_free_way() -> None:
    """Too far is what a robot drives through; light below zero and too late light are faults."""
    # sensor of a noise of 2e-5 and 1e-3: 20 of them below zero, and w1 8 of them above w2
    columns = {"w1": [0.004, 0.032], "w2": [0.0, 0.04]}
    reading, distance = messages_of(SENSOR, {"crosstalk": [0.004, 0.02]}, columns)
    for said, fields in zip(reading, distance, strict=True):
        assert said["status"] == "none"
        assert math.isnan(said["range"])
        assert fields.signal_quality == 1
        assert fields.current_distance < fields.min_distance


def answer_of(**more: Any) -> dict[str, Any]:
    return {
        "sequence": 1, "time_s": 0.0, "status": "none", "range_m": None, "sd_m": None,
        "hypotheses": [], "misfit": False, "present": 0.0, "outlier": 0.0, **more,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ({}, "+inf"),
        ({"present": 0.04}, "+inf"),
        ({"present": 0.2}, "nan"),
        ({"outlier": 0.9}, "nan"),
        ({"misfit": True}, "nan"),
        ({"status": "calibrating"}, "nan"),
    ],
)
def test_a_stream_says_too_far_only_of_an_empty_scene(more: dict[str, Any], word: str) -> None:
    line = line_as_message(ROS, (0.02, 15.0), json.dumps(answer_of(**more)).encode())
    assert json.loads(line)["message"]["rep117"] == word


def test_two_ranges_are_no_range_and_the_variance_is_that_of_both() -> None:
    reading, distance = messages_of(WAVE, TWO_ROOTS, {"i": [-0.003174], "q": [-0.004943]})
    # 1.4552 and 1.9987 m, half their distance is 0.27 m, with an sd of 0.27 and 0.33 m
    assert reading[0]["status"] == "ambiguous"
    assert math.isnan(reading[0]["range"])
    assert math.sqrt(reading[0]["variance"]) == pytest.approx(
        math.sqrt(0.272**2 + (0.265**2 + 0.325**2) / 2), rel=0.01
    )
    assert (distance[0].signal_quality, distance[0].covariance) == (1, 255)
    assert distance[0].current_distance < distance[0].min_distance


@given(st.lists(st.tuples(st.floats(0.1, 10.0), st.floats(1e-4, 1.0)), min_size=1))
def test_total_variance(modes: list[tuple[float, float]]) -> None:
    """E[x^2] - E[x]^2 of the mixture, to rounding of the larger of the two."""
    means, sds = (np.array(column) for column in zip(*modes, strict=True))
    second = np.mean(means**2 + sds**2)
    found = total(means.tolist(), sds.tolist())
    assert found == pytest.approx(second - means.mean() ** 2, abs=1e-13 * second * len(modes))
    assert total(means.tolist(), [math.nan, *sds.tolist()[1:]]) is None
    assert total([], []) is None


def test_reasons_that_tell_a_side_are_reasons_of_techniques() -> None:
    """A reason that is worded anew has to be worded anew here."""
    said: set[str] = set()
    for technique in {**TECHNIQUES, **FITS}.values():
        module = sys.modules[technique.solve.__module__]
        said.update(getattr(module, "_REASONS", ()))
    assert set(SIDES) <= said


def test_names_and_media_types_differ() -> None:
    assert len({m.name for m in MESSAGES}) == len({m.media_type for m in MESSAGES}) == len(MESSAGES)


_STREAMED = {
    "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
    "discrepancy": 0,
}


def test_lines_of_a_stream_as_messages() -> None:
    """One range, none, an error: the message says what the line said, and never more."""
    model = Plain(tracker(parse_sensor(SENSOR), parse_scene(_STREAMED)))
    c0, c1, c2 = _STREAMED["object"].values()  # type: ignore[attr-defined]
    r = 0.8
    w2 = c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
    frames = [{"time_s": 0.1 * n, "w1": w2 * r / 14.9896, "w2": w2, "id": n} for n in range(6)]
    frames += [{"time_s": 0.6, "w1": 0.0, "w2": 0.0, "object_present": False}]
    frames += [{"time_s": 0.7, "w1": 9.0 * w2, "w2": 9.0 * w2}, {"time_s": 0.0}]
    lines = [Line(json.dumps(frame).encode(), 0.0) for frame in frames]
    answers = take(model, Place(model.first), lines, JsonLines(), Kept()).answers
    limits = limits_of_tracker(model.base)
    every = {}
    for form in (ROS, MAVLINK):
        found = [json.loads(line) for line in as_messages(form, limits, answers)]
        assert [line["sequence"] for line in found] == list(range(1, 10))
        assert found[4]["id"] == 4
        assert "message" not in found[8]
        assert found[8] == json.loads(answers[8])
        assert (found[5]["status"], found[6]["status"]) == ("unique", "none")
        every[form.name] = [found[n]["message"] for n in (5, 6, 7)]
    said, empty, strange = map(ros, every[ROS.name])
    answer = json.loads(answers[5])
    assert said["range"] == answer["range_m"]
    assert said["variance"] >= answer["sd_m"] ** 2
    assert empty["range"] == math.inf
    # nothing that the scene has reads so: it may be anything, right before the sensor
    assert (found[7]["status"], strange["status"]) == ("none", "none")
    assert math.isnan(strange["range"])
    near, nothing, _ = map(mavlink, every[MAVLINK.name])
    assert abs(near.current_distance - 80) <= 1
    assert (near.signal_quality, nothing.signal_quality) == (100, 1)
    assert nothing.current_distance > nothing.max_distance


@given(
    st.floats(0.1, 3.0), st.floats(0.1, 3.0), st.floats(0.05, 0.95),
    st.sampled_from(["ambiguous", "saturated", "unique"]), st.booleans(),
)  # fmt: skip
def test_two_modes_are_never_one(
    one: float, other: float, share: float, status: str, misfit: bool
) -> None:
    hypotheses = [
        {"range_m": one, "sd_m": 0.01, "weight": share},
        {"range_m": other, "sd_m": 0.01, "weight": 1 - share},
    ]
    unique = status == "unique"
    answer = {
        "sequence": 1, "time_s": 0.0, "status": status, "range_m": one if unique else None,
        "sd_m": 0.01 if unique else None, "hypotheses": hypotheses, "misfit": misfit,
    }  # fmt: skip
    line = json.dumps(answer).encode()
    written = [line_as_message(form, (0.02, 15.0), line) for form in (ROS, MAVLINK)]
    range_, distance = (json.loads(text)["message"] for text in written)
    if unique and not misfit:
        assert range_["range"] == one
        assert range_["variance"] >= 0.99 * (1 - share) * (one - other) ** 2
        return
    assert range_["range"] is None
    assert distance["signal_quality"] == 1
    if status == "ambiguous":
        between = share * (1 - share) * (one - other) ** 2
        assert range_["variance"] >= 0.99 * between


def test_what_a_client_of_a_stream_accepts() -> None:
    assert message_for("") is message_for("*/*") is message_for("application/json") is None
    assert message_for(ROS.media_type) is ROS
    assert lines_type(MAVLINK).endswith(f'profile="{MAVLINK.media_type}"')
    for message in (ROS, MAVLINK):  # as its lines are answered
        assert message_for(lines_type(message)) is message
        assert message_for(f"application/x-ndjson; q=0.5, {lines_type(message)}") is message
        assert message_for(f"application/ndjson;profile={message.media_type}") is message
    assert message_for("application/x-ndjson; charset=utf-8") is None
    assert message_for(f"{lines_type(ROS)}; q=0, application/x-ndjson") is None
    with pytest.raises(NotAcceptableError):
        message_for("text/html")
    with pytest.raises(NotAcceptableError, match='profile="application'):
        message_for('application/x-ndjson; profile="urn:example:unknown"')
    # one that takes less is told what else there is, or answered by that
    assert message_for('application/x-ndjson; profile="urn:example:unknown", */*;q=0.1') is None


def test_a_profile_that_no_answer_has_is_not_acceptable() -> None:
    forms = ("application/json", "application/x-ndjson")
    assert accepted_type('application/json; profile="urn:x"', forms) is None
    assert accepted_type("application/json; charset=utf-8", forms) == "application/json"
