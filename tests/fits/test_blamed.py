"""A fit that does not explain its frames names the frames, or the unknown, that are to blame."""

import dataclasses

import numpy as np
import pytest

import hybridtof
from simulator.frames import Frames
from simulator.sensor import Sensor
from tests.posterior.scenes import KINDS

NOISE = 1e-4
OBJECT = {"c0": 0.08, "c1": -0.1, "c2": 0.1}
EMPTY, FRAMES = 4, 18


def frames_of(kind: str, gain: float = 1.0) -> tuple[Sensor, Frames]:
    """Empty frames first, then an object from 0.25 to 1.2 m, behind crosstalk; in units of gain."""
    noise = {"read": [gain * NOISE, gain * NOISE]}
    sensor = hybridtof.parse_sensor(KINDS[kind] | {"noise": noise})
    crosstalk = [gain * 0.004, gain * 0.02]
    truth = hybridtof.parse_scene(
        {"object": OBJECT | {"c2": gain * OBJECT["c2"]}, "crosstalk": crosstalk}
    )
    path = hybridtof.SampledTrajectory(
        range_m=[1.0] * EMPTY + np.geomspace(0.25, 1.2, FRAMES).tolist(),
        object_present=[False] * EMPTY + [True] * FRAMES,
    )
    return sensor, hybridtof.simulate(sensor, truth, path, seed=3).frames


def reasons(sensor: Sensor, frames: Frames, gain: float = 1.0) -> list[str]:
    prior = {"prior": "normal", "mean": 0.0, "sd": 0.1 * gain}
    scene = hybridtof.parse_scene({"crosstalk": [prior, prior]})
    (result,) = hybridtof.estimate(sensor, scene, frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.fit["misfit"] == bool(result.fit["reasons"])
    return list(result.fit["reasons"])


def disturbed(frames: Frames, *places: int) -> Frames:
    """Half as much light as there is, as late as it is: errors of the model would follow it."""
    readings = frames.readings.copy()
    readings[list(places)] *= np.array([[0.5, 0.8]])
    return dataclasses.replace(frames, readings=readings)


@pytest.mark.parametrize(
    ("kind", "places"),
    [
        pytest.param("pulsed", (12,), marks=pytest.mark.thorough),
        ("pulsed", (8, 14)),
        pytest.param("sine_wave", (20,), marks=pytest.mark.thorough),
    ],
)
def test_frames_of_something_else_are_named(kind: str, places: tuple[int, ...]) -> None:
    sensor, frames = frames_of(kind)
    assert reasons(sensor, frames) == []
    named = [text for text in reasons(sensor, disturbed(frames, *places)) if "alone" in text]
    (text,) = named
    word = "frame" if len(places) == 1 else "frames"
    assert text.startswith(f"{word} {' and '.join(map(str, places))} (counted from 0) alone")


def test_frames_are_counted_as_they_were_sent() -> None:
    """Those before it that are saturated are no frames of the fit."""
    sensor, frames = frames_of("pulsed")
    full = {"full_scale": [1.0, 1.01 * float(frames.readings[EMPTY + 1, 1])]}
    sensor = hybridtof.parse_sensor({**sensor.model_dump(), **full})
    assert frames.saturated(sensor)[EMPTY]
    (text,) = [text for text in reasons(sensor, disturbed(frames, 20)) if "alone" in text]
    assert text.startswith("frame 20 ")


def test_an_empty_frame_with_light_of_its_own_is_named() -> None:
    sensor, frames = frames_of("sine_wave")
    readings = frames.readings.copy()
    readings[2] += 50 * NOISE
    told = reasons(sensor, dataclasses.replace(frames, readings=readings))
    assert any(text.startswith("frame 2 (counted from 0) alone") for text in told)


def test_what_all_frames_have_names_none() -> None:
    """Noise that is three times as large as is stated."""
    sensor, frames = frames_of("pulsed")
    more = np.random.default_rng(1).normal(0.0, 2.8 * NOISE, frames.readings.shape)
    told = reasons(sensor, dataclasses.replace(frames, readings=frames.readings + more))
    assert told
    assert not any("alone" in text for text in told)


def test_a_gain_that_nobody_measured_is_thought_of() -> None:
    """Readings in counts; c2 is then as much larger, and its default prior supposes a gain of 1."""
    told = reasons(*frames_of("pulsed", gain=3e4), gain=3e4)
    (text,) = [text for text in told if text.startswith("object.c2 lies")]
    assert "gain" in text


@pytest.mark.parametrize("places", [pytest.param((2,), marks=pytest.mark.thorough), (8, 16)])
def test_frames_that_read_zero_are_named_where_they_bend_the_fit(places: tuple[int, ...]) -> None:
    """Of an empty frame at zero, or two that hide one another, nothing is linear any more."""
    sensor, frames = frames_of("sine_wave")
    readings = frames.readings.copy()
    readings[list(places)] = 0.0
    told = reasons(sensor, dataclasses.replace(frames, readings=readings))
    named = " and ".join(map(str, places))
    assert any(f"{named} (counted from 0) alone" in text for text in told)
