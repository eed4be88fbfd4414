"""What a tracker refuses, and readings that it survives."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import state_from_bytes
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from tests.tracking.scenes import FOLDED, PLATE, frames_of, read, scene_of, sensor_of
from tests.tracking.tracks import NORMAL, SNR_100


def test_extreme_readings_leave_nothing_that_is_not_finite() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(FOLDED)
    readings = np.array([[0.0, 0.0], [1e300, -1e300], [1e-300, 1.0], [-5.0, 1e12], [0.01, 0.1]])
    result = track(sensor, scene, frames_of(readings))
    assert np.isfinite(result.present).all()
    assert np.isfinite(result.surprise).all()
    assert np.isfinite(result.outlier).all()
    there = result.status != Status.NONE
    assert np.isfinite(result.best_m[there]).all()
    assert np.isfinite(result.best_sd_m[there]).all()


def test_times_are_needed_and_must_increase() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    readings = read(sensor, scene, np.full(3, 0.7), np.random.default_rng(1))
    for times in (None, np.array([0.0, 0.1, 0.1]), np.array([0.0, 0.2, 0.1])):
        with pytest.raises(InvalidInputError, match="/frames/time_s"):
            track(sensor, scene, Frames(readings, time_s=times))
    model = tracker(sensor, scene)
    state, _ = step(model, model.first, frames_of(readings))
    with pytest.raises(InvalidInputError, match="not later"):
        step(model, state, frames_of(readings))


def test_bad_frames_are_named() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    readings = read(sensor, scene, np.full(3, 0.7), np.random.default_rng(1))
    good = frames_of(readings)
    spoilt = readings.copy()
    spoilt[1, 0] = np.nan
    gains = (np.array([1.0, 0.0, 1.0]), np.array([1.0, np.nan, 1.0]), np.ones(2))
    first = sensor.columns[0]
    for frames, column in (
        (dataclasses.replace(good, readings=spoilt), first),
        (dataclasses.replace(good, readings=readings[:0], time_s=np.empty(0)), first),
        *((dataclasses.replace(good, gain=gain), "gain") for gain in gains),
        (dataclasses.replace(good, object_present=np.ones(2, dtype=bool)), "object_present"),
    ):
        with pytest.raises(InvalidInputError, match=f"/frames/{column}"):
            track(sensor, scene, frames)


def test_a_state_belongs_to_its_tracker() -> None:
    sensor = sensor_of(SNR_100)
    one, other = tracker(sensor, scene_of(PLATE)), tracker(sensor, scene_of(FOLDED))
    with pytest.raises(InvalidInputError, match="/state"):
        step(one, other.first, frames_of(np.zeros((1, 2))))
    for data in (b"", b"nonsense"):
        with pytest.raises(InvalidInputError, match="/state"):
            state_from_bytes(data)


@pytest.mark.parametrize(
    ("scene", "settings", "match"),
    [
        ({}, {}, "object.c0"),
        ({"object": {"c0": 0.1, "c1": 0.0}}, {}, "object.c2 unknown.*discrepancy.flux"),
        ({**PLATE, "motion": "tangential"}, {}, "tangential"),
        ({**PLATE, "crosstalk": {"values": [0.0, 0.0], "optional": True}}, {}, "optional"),
        ({"object": PLATE["object"], "background": {**FOLDED["background"], "shadow": {
            "c0": 0.1, "c1": -0.6}}, "range_m": {"prior": "loguniform", "low": 0.1, "high": 0.5}},
         {}, "range_m"),
    ],
)  # fmt: skip
def test_what_cannot_be_tracked_is_refused(
    scene: dict[str, Any], settings: dict[str, Any], match: str
) -> None:
    sensor = sensor_of(SNR_100, noise={"derivative": [1.0, 1.0]})
    with pytest.raises(RefusedError, match=match):
        tracker(sensor, scene_of(scene), TrackingSettings(**settings))


def test_bad_arguments_are_named() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    with pytest.raises(InvalidInputError, match="/scene/object/c0"):
        tracker(sensor, scene_of({"object": {"c0": -1.0}}))
    with pytest.raises(InvalidInputError, match="/settings/observables"):
        tracker(sensor_of(1e-3, "sine_wave"), scene, TrackingSettings(observables="w2"))
    derivatives = TrackingSettings(observables="derivatives")
    with pytest.raises(InvalidInputError, match="/sensor/noise/derivative"):
        tracker(sensor, scene, derivatives)
    model = tracker(sensor_of(SNR_100, noise={"derivative": [1.0, 1.0]}), scene, derivatives)
    with pytest.raises(InvalidInputError, match="/frames/dw1_dt"):
        step(model, model.first, frames_of(np.zeros((1, 2))))
    unknown = scene_of(PLATE, object={"c0": {**NORMAL, "sd": 1.0}, "c1": 0.0, "c2": 0.1})
    for draws, match in (
        (np.ones((100, 2)), "column"),
        (np.ones((5, 1)), "needs 20"),
        (np.full((100, 1), np.nan), "finite"),
        (np.full((100, 1), -1.0), "outside"),
    ):
        with pytest.raises(InvalidInputError, match=match):
            tracker(sensor, unknown, None, draws)
