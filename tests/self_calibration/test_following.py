"""Streams that calibrate themselves, with made-up calibrations: when, what, and how told."""

import dataclasses
import itertools
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from inference.posterior.settings import SamplerSettings
from inference.self_calibration.calibration import Asked, Outcome, outcome_of, sampler_of
from inference.self_calibration.following import Conclude, conclude, follow
from inference.self_calibration.gathering import EMPTY, in_order, thinned
from inference.self_calibration.looking import EVERY
from inference.self_calibration.plan import Plan, begin, plan_of
from inference.self_calibration.scenes import open_names, trackable
from inference.self_calibration.state import (
    CalibrationState,
    calibration_from_bytes,
    calibration_to_bytes,
)
from inference.tracking.settings import TrackingSettings
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [8e-5, 8e-5]}})
STATED = parse_scene(
    {
        "object": OBJECT,
        "crosstalk": [
            {"prior": "normal", "mean": 0.0, "sd": 0.002},
            {"prior": "normal", "mean": 0.0, "sd": 0.01},
        ],
        "range_m": {"prior": "loguniform", "low": 0.1, "high": 5.0},
        "discrepancy": 0,
    }
)
STILL = TrackingSettings(rate_sd=0.5, crosstalk_drift=(0.0, 0.0))
PLAN = plan_of(SENSOR, STATED, STILL, 7)
DRIFTING = plan_of(SENSOR, STATED, TrackingSettings(rate_sd=0.5), 7)
TRUTH = (0.001, 0.006)
N, CHANGE = 600, 330


def course(after: tuple[float, float] = TRUTH) -> Frames:
    """20 s to and fro, two of them known to be empty, at 30 Hz; crosstalk that may change."""
    t = np.arange(N) / 30
    there = t >= 2.0
    path = SampledTrajectory(
        range_m=np.exp(np.log(0.67) + 0.8 * np.sin(2 * np.pi * t / 9)).tolist(),
        time_s=t.tolist(),
        object_present=there.tolist(),
    )
    readings = simulate(SENSOR, parse_scene({"object": OBJECT, "discrepancy": 0}), path, 3)
    crosstalk = np.where((np.arange(N) < CHANGE)[:, None], TRUTH, after)
    return Frames(readings=readings.frames.readings + crosstalk, time_s=t, object_present=there)


def known(crosstalk: tuple[float, float], sd: float = 2e-5) -> Scene:
    """Return what a good posterior would make of the priors."""
    mode = {
        "mean": [crosstalk[0] / 0.002, crosstalk[1] / 0.01],
        "covariance": [[(sd / 0.002) ** 2, 0.0], [0.0, (sd / 0.01) ** 2]],
    }
    document = STATED.model_dump(mode="json", exclude_none=True)
    joint = {"unknowns": ["crosstalk.w1", "crosstalk.w2"], "modes": [mode]}
    return parse_scene(document | {"joint": joint})


GOOD = {"range_m": "identified", "crosstalk.w1": "identified", "crosstalk.w2": "identified"}


def told(*outcomes: Outcome, lag: int = 60) -> Conclude:
    """Conclude calibrations by what is given, one after the other."""

    def concluding(state: CalibrationState) -> CalibrationState:
        asked = state.asked
        assert isinstance(asked, Asked)
        if asked.number > len(outcomes):
            return state
        return conclude(state, outcomes[asked.number - 1], asked.decided_at + lag)

    return concluding


def run(
    frames: Frames,
    concluding: Conclude | None,
    cuts: tuple[int, ...] = (),
    stored: bool = False,
    plan: Plan = PLAN,
) -> tuple[CalibrationState, NDArray[np.float64], list[dict[str, Any]]]:
    state, rows, events = begin(plan), [], []
    edges = (0, *sorted(cuts), len(frames))
    for a, b in itertools.pairwise(edges):
        if a == b:
            continue
        part = frames.select(slice(a, b))
        state, pieces = follow(plan, state, part, range(a + 1, b + 1), concluding)
        if stored:
            state = calibration_from_bytes(calibration_to_bytes(state))
        for piece in pieces:
            track = piece.track
            rows.append(np.column_stack([track.range_m, track.sd_m, track.present, track.misfit]))
            events += [] if piece.event is None else [piece.event]
    return state, np.concatenate(rows), events


def test_a_stream_from_priors_becomes_known_and_says_so() -> None:
    frames = course()
    state, rows, events = run(frames, told(Outcome(known(TRUTH), "", False, GOOD)))
    (event,) = events
    assert (event["kind"], event["number"], event["reason"]) == (
        "taken",
        1,
        "the scene is not known",
    )
    assert event["applies_at"] == event["sequence"] == event["decided_at"] + 60
    assert event["decided_at"] % EVERY == 0
    assert 0 < event["from_sequence"] < event["to_sequence"] <= event["decided_at"]
    assert event["frames_without_object"] > 0
    assert state.known
    before, after = (event[side]["scene"]["crosstalk.w2"] for side in ("before", "after"))
    assert before["q05"] < 0 < before["q95"]
    assert after["q95"] - after["q05"] < 1e-4
    assert after["q50"] == pytest.approx(TRUTH[1], abs=1e-4)
    at = event["sequence"] - 1
    # the answer of the line is that of the new scene, from a tracker that has settled
    assert event["after"]["range_m"] == rows[at, 0]
    assert rows[at, 1] < 0.2 * event["before"]["sd_m"]
    assert json.loads(json.dumps(event)) == event


def test_answers_before_a_calibration_are_honest() -> None:
    """Crosstalk as wide as its prior is in every standard deviation."""
    frames = course()
    _, rows, events = run(frames, None)
    assert events == []
    truth = np.exp(np.log(0.67) + 0.8 * np.sin(2 * np.pi * np.arange(N) / 30 / 9))
    answered = np.isfinite(rows[:, 0])
    assert answered[60:].mean() > 0.5
    assert not answered[:60].any()
    # 5 standard deviations of an error that frames share: false-alarm rate 1e-6
    assert (np.abs(rows[:, 0] - truth) <= 5 * rows[:, 1])[answered].all()


@settings(max_examples=5, deadline=None)
@given(st.lists(st.integers(1, N - 1), max_size=6), st.booleans())
def test_cuts_and_stores_change_nothing(cuts: list[int], stored: bool) -> None:
    frames = course((0.003, 0.02))
    outcomes = told(Outcome(known(TRUTH), "", False, GOOD), Outcome(None, "no", False))
    _, rows, events = run(frames, outcomes, plan=DRIFTING)
    state, again, told_again = run(frames, outcomes, tuple(cuts), stored, DRIFTING)
    assert np.array_equal(rows, again, equal_nan=True)
    assert events == told_again
    assert [event["kind"] for event in state.events][:2] == ["taken", "doubted"]


def test_a_change_is_noticed_told_and_learnt() -> None:
    changed = (0.003, 0.02)
    good = [Outcome(known(c), "", False, GOOD) for c in (TRUTH, changed)]
    state, rows, events = run(course(changed), told(*good))
    assert [event["kind"] for event in events] == ["taken", "doubted", "taken"]
    first, doubted, second = events
    # two looks, and what had begun
    assert CHANGE < doubted["sequence"] <= CHANGE + 4 * EVERY
    assert doubted["reason"] == "most frames contradict the scene"
    # what came before the change tells nothing of the scene behind it
    assert second["from_sequence"] > CHANGE
    assert second["after"]["scene"]["crosstalk.w2"]["q50"] == pytest.approx(0.02, abs=1e-4)
    assert first["seed"] != second["seed"]
    assert state.known
    assert np.isfinite(rows[second["sequence"] - 1 :, 0]).all()


def test_what_is_not_taken_changes_nothing_and_is_asked_for_again_later() -> None:
    frames = course()
    refused = Outcome(None, "it has not converged: rhat", False)
    _, rows, events = run(frames, told(*[refused] * 9))
    assert [event["kind"] for event in events] == ["not_taken"] * len(events)
    assert len(events) >= 2
    asked = [event["decided_at"] for event in events]
    concluded = [event["sequence"] for event in events]
    assert asked[1] - concluded[0] >= 10 * EVERY - 1
    assert np.array_equal(rows, run(frames, None)[1], equal_nan=True)


def test_a_calibration_that_the_frames_since_contradict_is_not_taken() -> None:
    wrong = Outcome(known((0.0, -0.002)), "", False, GOOD)
    state, rows, events = run(course(), told(wrong))
    assert (events[0]["kind"], events[0]["reason"]) == (
        "not_taken",
        "the last frames contradict it",
    )
    assert not state.known
    assert np.array_equal(rows, run(course(), None)[1], equal_nan=True)


def test_a_calibration_that_is_a_little_off_is_taken_as_wide_as_frames_demand() -> None:
    """Crosstalk wrong by a quarter: taken, and the stream goes on calibrating."""
    state, rows, events = run(course(), told(Outcome(known((0.0013, 0.0075)), "", False, GOOD)))
    assert events[0]["kind"] == "taken"
    assert not state.known
    assert state.drift is not None
    assert state.drift.jump > 0.0
    truth = np.exp(np.log(0.67) + 0.8 * np.sin(2 * np.pi * np.arange(N) / 30 / 9))
    late = slice(events[0]["sequence"], None)
    answered = np.isfinite(rows[late, 0])
    assert answered.mean() > 0.3
    # 5 standard deviations of an error that frames share: false-alarm rate 1e-6
    assert (np.abs(rows[late, 0] - truth[late]) <= 5 * rows[late, 1])[answered].all()


def test_empty_frames_that_move_give_a_scene_up() -> None:
    """A change of 2 read noises in w1 alone: no single frame shows it."""
    n = 240
    readings = np.tile(np.array(TRUTH), (n, 1)) + 8e-5 * np.random.default_rng(1).normal(
        size=(n, 2)
    )
    readings[120:, 0] += 1.6e-4
    frames = Frames(readings, np.arange(n) / 30, object_present=np.zeros(n, dtype=bool))
    plan = plan_of(SENSOR, known(TRUTH), STILL, 7)
    state, pieces = follow(plan, begin(plan), frames, range(1, n + 1))
    events = [piece.event for piece in pieces if piece.event is not None]
    assert [(e["kind"], e["reason"]) for e in events] == [
        ("doubted", "frames without the object have moved")
    ]
    assert 120 < events[0]["sequence"] <= 120 + 2 * EVERY
    before, after = (events[0][which]["scene"]["crosstalk.w1"] for which in ("before", "after"))
    assert before["q05"] < TRUTH[0] < before["q95"]
    assert after["q05"] > before["q95"]
    assert state.asked is not None  # empty frames alone are worth a calibration of crosstalk


def test_gathered_frames_are_few_of_each_amplitude() -> None:
    state, _, _ = run(course(), None)
    kept = state.asked
    assert kept is not None
    kinds = state.gathered.kind
    steps, counts = np.unique(kinds[kinds >= 0], return_counts=True)
    assert counts.max() <= 2
    assert len(steps) >= 6
    assert (kinds == EMPTY).sum() == 24
    # the same, however they come
    whole = state.recent
    halves = in_order(thinned(whole.select(slice(0, 60)), 0), whole.select(slice(60, None)))
    assert np.array_equal(thinned(halves, 0).sequence, thinned(whole, 0).sequence)


def test_seeds_and_settings_of_a_calibration() -> None:
    state, _, _ = run(course(), None)
    assert state.asked is not None
    assert isinstance(sampler_of(state.asked), SamplerSettings)
    other = dataclasses.replace(PLAN, seed=8)
    there, _ = follow(other, begin(other), course(), range(1, N + 1))
    assert there.asked is not None
    assert there.asked.seed != state.asked.seed
    assert there.asked.sequence == state.asked.sequence


def test_posteriors_are_taken_only_where_they_say_so() -> None:
    good: dict[str, Any] = {
        "verdict": {"converged": True, "reasons": []},
        "fit": {"misfit": False, "reasons": []},
        "identifiability": [{"parameter": "range_m", "status": "weak"}],
    }
    scene = known(TRUTH)
    assert outcome_of(good, scene) == Outcome(scene, "", False, {"range_m": "weak"})
    bad = good | {"verdict": {"converged": False, "reasons": ["rhat 1.3"]}}
    assert outcome_of(bad, scene).reason == "it has not converged: rhat 1.3"
    assert outcome_of(bad, scene).scene is None
    misfit = outcome_of(good | {"fit": {"misfit": True, "reasons": ["total"]}}, scene)
    assert (misfit.scene, misfit.misfit) == (None, True)
    assert outcome_of(good, None).scene is None


def test_a_scene_without_unknowns_is_refused() -> None:
    plain = parse_scene({"object": OBJECT, "crosstalk": [0.0, 0.0]})
    with pytest.raises(InvalidInputError, match="/calibrate: nothing of the scene is unknown"):
        plan_of(SENSOR, plain, TrackingSettings(), 1)


def test_a_calibrated_scene_is_known_from_the_start() -> None:
    plan = plan_of(SENSOR, known(TRUTH), TrackingSettings(), 1)
    state = begin(plan)
    assert state.known
    assert state.before == STATED
    assert state.scene == known(TRUTH)


def test_what_no_law_names_has_its_prior() -> None:
    scene = trackable(SENSOR, STATED)
    assert scene.joint is not None
    assert scene.joint.unknowns == open_names(SENSOR, STATED)
    assert trackable(SENSOR, known(TRUTH)) == known(TRUTH)
    assert isinstance(PLAN, Plan)
    with pytest.raises(InvalidInputError, match="/state"):
        calibration_from_bytes(b"something else")


def test_readings_that_move_within_the_law_are_a_doubt() -> None:
    """Crosstalk is known to a fifth, and shifts by less than that: nothing contradicts the law."""
    plan = plan_of(SENSOR, known(TRUTH, 1.2e-3), STILL, 7)
    _, rows, events = run(course((0.0014, 0.0068)), None, plan=plan)
    doubted = events[0]
    assert (doubted["kind"], doubted["reason"]) == (
        "doubted",
        "the readings of all ranges have moved",
    )
    # the object is back at ranges where it was before within half of its period of 9 s
    assert CHANGE < doubted["sequence"] <= CHANGE + 6 * EVERY
    state, _, again = run(course((0.0014, 0.0068)), None, (200, 400), stored=True, plan=plan)
    assert again == events
    assert (state.doubts, state.known) == (2, False)
    truth = np.exp(np.log(0.67) + 0.8 * np.sin(2 * np.pi * np.arange(N) / 30 / 9))
    late = slice(doubted["sequence"], None)
    answered = np.isfinite(rows[late, 0])
    assert answered.any()
    # the shift is less than a standard deviation of what the intervals hold
    assert (np.abs(rows[late, 0] - truth[late]) <= 3 * rows[late, 1])[answered].all()


def test_a_gain_that_follows_the_temperature_is_a_gain_of_each_frame() -> None:
    """To the last bit, calibrations included."""
    drift, kelvin = -0.003, 298.15 + np.linspace(-5.0, 15.0, N)
    warm = parse_sensor(
        SENSOR.model_dump(mode="json", exclude_none=True)
        | {"temperature": {"gain_drift_per_k": drift, "reference_k": 298.15}}
    )
    plan = plan_of(warm, STATED, STILL, 7)
    frames = course()
    gain = 1.0 + drift * (kelvin - 298.15)
    light = frames.readings - TRUTH
    readings = light * gain[:, None] + TRUTH
    told_gain = dataclasses.replace(frames, readings=readings, gain=gain)
    told_kelvin = dataclasses.replace(frames, readings=readings, temperature_k=kelvin)
    outcome = Outcome(known(TRUTH), "", False, GOOD)
    expected = run(told_gain, told(outcome))
    found = run(told_kelvin, told(outcome), cuts=(100, 431), stored=True, plan=plan)
    np.testing.assert_array_equal(found[1], expected[1])
    assert found[2] == expected[2]
    assert found[0].gathered.frames is not None
    assert found[0].gathered.frames.gain is not None
    kelvin[3] = np.nan
    with pytest.raises(InvalidInputError, match="/frames/temperature_k: entry 3 is not known"):
        run(dataclasses.replace(told_kelvin, temperature_k=kelvin), None, plan=plan)
    with pytest.raises(InvalidInputError, match="/frames/temperature_k: is missing"):
        run(told_gain, None, plan=plan)


@pytest.mark.parametrize(
    ("temperature", "crosstalk", "refused"),
    [
        ({"delay_drift_s_per_k": 1e-12}, None, "takes delay_drift_s_per_k beside"),
        ({"gain_drift_per_k": {"prior": "normal", "mean": 0, "sd": 0.1}}, None, "unknown"),
        ({"delay_drift_s_per_k": 1e-12}, [0.001, 0.006], None),
        ({"gain_drift_per_k": -0.003}, None, None),
    ],
)
def test_which_temperature_coefficients_a_stream_takes(
    temperature: dict[str, Any], crosstalk: list[float] | None, refused: str | None
) -> None:
    document = SENSOR.model_dump(mode="json", exclude_none=True) | {"temperature": temperature}
    stated: dict[str, Any] = {"range_m": {"prior": "loguniform", "low": 0.1, "high": 5.0}}
    scene = STATED
    if crosstalk is not None:
        scene = parse_scene(stated | {"crosstalk": crosstalk, "discrepancy": 0})
    if refused is None:
        plan = plan_of(parse_sensor(document), scene, STILL, 7)
        assert plan.sensor == SENSOR
        return
    with pytest.raises(RefusedError, match=refused):
        plan_of(parse_sensor(document), scene, STILL, 7)
