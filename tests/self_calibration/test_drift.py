"""Crosstalk that drifts: laws that grow wider, are renewed by empty frames, and rates learnt."""

import dataclasses

import numpy as np
import pytest

from inference.estimates import Status
from inference.self_calibration.ageing import wide_enough, widened
from inference.self_calibration.drift import (
    Drift,
    EmptyMeans,
    aged,
    conditioned,
    crosstalk_of,
    drift_sd,
    walked,
)
from inference.self_calibration.following import follow
from inference.self_calibration.plan import begin, plan_of
from inference.self_calibration.withholding import withheld
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.self_calibration.test_following import OBJECT, SENSOR, TRUTH, course, known

NAMES = ("crosstalk.w1", "crosstalk.w2")
PLAN = plan_of(SENSOR, known(TRUTH), TrackingSettings(rate_sd=0.5), 7)


def test_a_law_grows_wider_as_the_root_of_time() -> None:
    law = known(TRUTH)
    drift = Drift(law, 0.0, 0.0)
    for seconds in (1.0, 100.0):
        sd = drift_sd(SENSOR, drift, seconds, None)
        assert sd is not None
        # 1 % of the crosstalk in the root of a second; from 1000 draws, 2.2 %
        np.testing.assert_allclose(sd, 0.01 * np.sqrt(seconds) * np.array(TRUTH), rtol=0.05)
        wider = crosstalk_of(SENSOR, aged(law, NAMES, sd))
        assert wider is not None
        np.testing.assert_allclose(wider[1], np.hypot(sd, 2e-5), rtol=0.12)
    # a rate that is stated is no share of anything
    stated = drift_sd(SENSOR, drift, 4.0, (3e-5, 0.0))
    assert stated is not None
    assert stated.tolist() == [6e-5, 0.0]
    assert aged(law, NAMES, np.zeros(2)) is law


def test_what_has_no_unknown_crosstalk_does_not_age() -> None:
    scene = parse_scene({"crosstalk": [0.001, 0.006]})
    assert crosstalk_of(SENSOR, scene) is None
    assert drift_sd(SENSOR, Drift(scene, 0.0, 0.0), 100.0, None) is None
    drift, same = widened(PLAN, Drift(scene, 0.0, 0.0), 100.0)
    assert same is scene
    assert drift.until_s == float("inf")


def test_near_the_end_of_a_prior_a_law_stays_a_law() -> None:
    document = {
        "object": OBJECT,
        "crosstalk": [0.001, {"prior": "halfnormal", "sd": 0.025}],
        "joint": {
            "unknowns": ["crosstalk.w2"],
            "modes": [{"mean": [-2.5], "covariance": [[1e-4]]}],
        },
    }
    scene = parse_scene(document)
    before = crosstalk_of(SENSOR, scene)
    assert before is not None
    # many times as far as the crosstalk is from zero
    wide = crosstalk_of(SENSOR, aged(scene, NAMES, np.array([0.0, 0.01])))
    assert wide is not None
    assert wide[1][1] > 5 * before[1][1]
    assert np.isfinite(wide).all()


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_empty_frames_condition_a_law_as_gaussians_are(unit: float) -> None:
    """Against sums of precisions; the prior is normal, so that nothing is approximated."""
    noise = {"read": [8e-5 * unit, 8e-5 * unit]}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "gain": unit, "noise": noise})
    prior = np.array([0.002, 0.01]) * unit
    mean, covariance = np.array([0.5, 0.6]), np.array([[4e-3, 1e-3], [1e-3, 2e-3]])
    scene = parse_scene(
        {
            "object": OBJECT,
            "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": sd} for sd in prior.tolist()],
            "joint": {
                "unknowns": list(NAMES),
                "modes": [{"mean": mean.tolist(), "covariance": covariance.tolist()}],
            },
        }
    )
    read, sd = np.array([0.0011, 0.0065]) * unit, np.array([3e-5, 9e-5]) * unit
    after, surprise = conditioned(sensor, scene, EmptyMeans(read, sd, 1.0, 0.0))
    assert after.joint is not None
    precision = np.linalg.inv(covariance) + np.diag(np.square(prior / sd))
    wanted = np.linalg.solve(
        precision, np.linalg.solve(covariance, mean) + prior * read / np.square(sd)
    )
    np.testing.assert_allclose(after.joint.modes[0].mean, wanted, rtol=1e-9)
    np.testing.assert_allclose(
        after.joint.modes[0].covariance, np.linalg.inv(precision), rtol=1e-6, atol=1e-12
    )
    spread = np.diag(np.square(sd / prior)) + covariance
    off = read / prior - mean
    assert surprise == pytest.approx(off @ np.linalg.solve(spread, off), rel=1e-9)


def test_a_reading_that_is_not_used_tells_nothing() -> None:
    means = EmptyMeans(np.array([0.5, 0.0061]), np.array([np.inf, 1e-5]), 1.0, 0.0)
    after, _ = conditioned(SENSOR, known(TRUTH, 1e-4), means)
    found = crosstalk_of(SENSOR, after)
    assert found is not None
    # from 1000 draws: 5 standard errors
    assert abs(found[0][0] - TRUTH[0]) < 5 * 1e-4 / np.sqrt(1000)
    assert abs(found[0][1] - 0.0061) < 2e-6


def test_the_rate_is_learnt_and_jumps_are_no_walk() -> None:
    rng = np.random.default_rng(4)
    size, sd, step_s = np.array([1.0, 5.0]), np.array([1e-4, 5e-4]), 30.0
    for rate in (0.003, 0.03):
        drift = Drift(known(TRUTH), 0.0, 0.0)
        at = size.copy()
        for _ in range(60):
            next_at = at + rate * np.sqrt(step_s) * size * rng.standard_normal(2)
            drift = walked(drift, (size, 0.0 * size + sd), (size + next_at - at, sd), step_s)
            at = next_at
        # of 120 squares, limited above: 5 standard deviations of their mean, and the default
        assert 0.5 * rate < drift.rate < 1.7 * rate
    once = walked(Drift(known(TRUTH), 0.0, 0.0), (size, sd), (100 * size, sd), 60.0)
    assert once.rate < 1.5 * 0.01
    soon = Drift(known(TRUTH), 0.0, 0.0)
    assert walked(soon, (size, sd), (100 * size, sd), 1.0) is soon


def test_empty_frames_that_drift_renew_a_scene_without_a_doubt() -> None:
    n = 600
    rng = np.random.default_rng(2)
    drifting = np.linspace(0.0, 6e-4, n)[:, None] * np.array([0.2, 1.0])
    readings = np.array(TRUTH) + drifting + 8e-5 * rng.standard_normal((n, 2))
    frames = Frames(readings, np.arange(n) / 30, object_present=np.zeros(n, dtype=bool))
    state, pieces = follow(PLAN, begin(PLAN), frames, range(1, n + 1))
    assert all(piece.event is None for piece in pieces)
    found = crosstalk_of(SENSOR, state.scene)
    assert found is not None
    # from the last 5 seconds: within 5 standard deviations of what the law says
    truth = np.array(TRUTH) + drifting[-1]
    assert (np.abs(found[0] - truth) < 5 * found[1]).all()
    assert found[1][1] < 4e-4
    assert (np.abs(np.array(TRUTH) - found[0]) > 2e-5).all()


@pytest.mark.parametrize("far", [0.02, 0.5, -0.5])
def test_a_scene_is_given_up_for_empty_frames_however_far_they_are(far: float) -> None:
    """Ten to 250 standard deviations of the prior, as under a hand that is told to be nothing."""
    n = 120
    readings = np.array(TRUTH) + 8e-5 * np.random.default_rng(5).standard_normal((n, 2))
    readings[60:] += far
    frames = Frames(readings, np.arange(n) / 30, object_present=np.zeros(n, dtype=bool))
    state, pieces = follow(PLAN, begin(PLAN), frames, range(1, n + 1))
    (event,) = (piece.event for piece in pieces if piece.event is not None)
    assert (event["kind"], event["sequence"]) == ("doubted", 91)
    assert event["before"]["scene"]["crosstalk.w1"]["q95"] < 2 * TRUTH[0]
    assert not state.calibrated


def test_crosstalk_that_has_walked_is_no_object() -> None:
    """An empty scene whose crosstalk is off by 2 of its errors, or by 2 of it and the noise."""
    n, noise = 90, 8e-5
    rng = np.random.default_rng(3)

    def frames_off_by(light: float) -> Frames:
        readings = np.array(TRUTH) + np.array([0.0, light]) + noise * rng.standard_normal((n, 2))
        return Frames(readings, np.arange(n) / 30)

    # a tracker sees to it that light within what is known of the crosstalk is none
    wide = PLAN.tracker(aged(known(TRUTH), NAMES, np.array([1e-4, 4e-4])))
    _, track = step(wide, wide.first, frames_off_by(2 * 4e-4))
    assert not (track.status == Status.UNIQUE).any()
    # and what stands above that for noise and a walk is withheld
    sd = np.array([1e-5, 4e-5])
    model = PLAN.tracker(aged(known(TRUTH), NAMES, sd))
    frames = frames_off_by(2 * np.hypot(sd[1], noise))
    _, track = step(model, model.first, frames)
    one = track.status == Status.UNIQUE
    off = np.square((frames.readings - TRUTH) / np.hypot(sd, noise)).sum(axis=1)
    # an empty scene surprises by 6 in 5 % of frames; beside what else is known, between 5.5 and 6.5
    assert (one & (off < 5.5)).sum() > 5  # what it is there for
    after = withheld(model, frames, track)
    assert not (after.status == Status.UNIQUE)[off < 5.5].any()
    assert (after.status == Status.UNIQUE)[one & (off > 6.5)].all()
    assert after.present[after.status == Status.AMBIGUOUS].max() <= 0.5
    assert np.isnan(after.range_m[after.status == Status.AMBIGUOUS]).all()
    # a range that is known is withheld from nobody
    told = dataclasses.replace(frames, known_range_m=np.ones(n), known_range_sd_m=np.ones(n))
    assert withheld(model, told, track) is track


def test_an_object_that_outshines_the_drift_keeps_its_range() -> None:
    frames = course().select(slice(60, 160))
    model = PLAN.tracker(aged(known(TRUTH), NAMES, np.array([2e-5, 1e-4])))
    _, track = step(model, model.first, frames)
    near = track.best_m < 1.0
    assert near.sum() > 30
    assert np.array_equal(withheld(model, frames, track).status[near], track.status[near])


def test_a_law_is_as_wide_as_frames_demand() -> None:
    frames = course().select(slice(60, 360))
    at = float(frames.time_s[-1]) if frames.time_s is not None else 0.0
    still = plan_of(SENSOR, known(TRUTH), TrackingSettings(crosstalk_drift=(0.0, 0.0)), 7)
    right = wide_enough(still, Drift(known(TRUTH), at, at), frames, at)
    assert right is not None
    assert right.jump == 0.0
    off = wide_enough(still, Drift(known((0.0014, 0.0078)), at, at), frames, at)
    assert off is not None
    assert off.jump == 0.4
    far = Drift(known((0.0, -0.002)), at, at)
    assert wide_enough(still, far, frames, at) is None
