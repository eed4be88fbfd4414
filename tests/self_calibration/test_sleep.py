"""A stream that calibrates itself has slept: its crosstalk walked meanwhile, and it says so."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.self_calibration.following import Piece, follow
from inference.self_calibration.plan import begin, plan_of
from inference.self_calibration.state import CalibrationState
from inference.tracking.settings import TrackingSettings
from simulator.frames import Frames
from tests.self_calibration.test_following import SENSOR, TRUTH, course, known

PLAN = plan_of(SENSOR, known(TRUTH), TrackingSettings(rate_sd=0.5), 7)
SLEPT_AT = 100  # not a multiple of the frames between two looks


def slept(seconds: float) -> Frames:
    """Frames of an object that comes near, the sensor asleep for some time among them."""
    frames = course().select(slice(60, 200))
    assert frames.time_s is not None
    time_s = frames.time_s.copy()
    time_s[SLEPT_AT:] += seconds
    return dataclasses.replace(frames, time_s=time_s)


def followed(frames: Frames, cuts: Sequence[int]) -> tuple[CalibrationState, list[Piece]]:
    state, pieces = begin(PLAN), []
    for start, end in zip((0, *cuts), (*cuts, len(frames)), strict=True):
        numbers = range(start + 1, end + 1)
        state, more = follow(PLAN, state, frames.select(slice(start, end)), numbers)
        pieces += more
    return state, pieces


def sds(pieces: list[Piece]) -> NDArray[np.float64]:
    return np.concatenate([piece.track.best_sd_m for piece in pieces])


@pytest.mark.parametrize("hours", [0.1, 1.0])
def test_the_first_frames_after_a_sleep_know_that_the_crosstalk_has_walked(hours: float) -> None:
    """By 19 and 60 % of itself: frames up to the next look were as sure as before the sleep."""
    frames = slept(3600.0 * hours)
    _, awake = followed(frames, ())
    _, always = followed(slept(0.0), ())
    until = 30 - SLEPT_AT % 30
    first = slice(SLEPT_AT + 2, SLEPT_AT + until)
    # what the walk of the crosstalk adds, by the answers from the next look on
    later = slice(SLEPT_AT + until, SLEPT_AT + 2 * until)
    grown = np.median(sds(awake)[first] / sds(always)[first])
    assert grown > 0.5 * np.median(sds(awake)[later] / sds(always)[later])
    assert grown > 2.0
    assert (sds(awake)[:SLEPT_AT] == sds(always)[:SLEPT_AT]).all()


@pytest.mark.parametrize("cuts", [(SLEPT_AT,), (SLEPT_AT - 3, SLEPT_AT + 1), tuple(range(1, 140))])
def test_however_the_frames_about_a_sleep_are_cut_the_answers_are_the_same(
    cuts: tuple[int, ...],
) -> None:
    frames = slept(600.0)
    state, pieces = followed(frames, ())
    other, more = followed(frames, cuts)
    assert np.array_equal(sds(pieces), sds(more))
    assert state.drift == other.drift
    assert state.scene == other.scene


def test_what_does_not_drift_sleeps_as_it_was() -> None:
    still = plan_of(SENSOR, known(TRUTH), TrackingSettings(crosstalk_drift=(0.0, 0.0)), 7)
    frames = slept(3600.0)
    state, _ = follow(still, begin(still), frames, range(1, len(frames) + 1))
    assert state.scene == begin(still).scene
