"""Objects that come and go, gaps, saturation, drifting crosstalk, uncertain scenes, bad input."""

import numpy as np
import pytest

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.sensor import parse_sensor
from tests.tracking.scenes import PLATE, STEP, frames_of, read, scene_of, sensor_of, wander
from tests.tracking.tracks import SNR_100, off


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_an_object_leaves_and_returns_elsewhere(kind: str) -> None:
    """It is seen to be gone in the next frame, and found again in the first one."""
    sensor, scene = sensor_of(SNR_100, kind), scene_of(PLATE)
    ranges = np.concatenate([np.full(30, 0.6), np.full(30, np.inf), np.full(30, 1.1)])
    rng = np.random.default_rng(1)
    result = track(sensor, scene, frames_of(read(sensor, scene, ranges, rng)))
    there = np.isfinite(ranges)
    assert (result.present[there] > 0.95).all()
    assert (result.present[~there] < 0.2).all()
    assert (result.status[there] == Status.UNIQUE).all()
    assert (result.status[~there] == Status.NONE).all()
    assert np.isnan(result.range_m[~there]).all()
    # 60 correlated normal errors: one beyond 5.5 in 400,000 runs
    assert np.abs(off(result, np.log(ranges))[there]).max() < 5.5
    assert not result.misfit.any()


def test_known_absence_needs_no_likelihood() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    readings = read(sensor, scene, np.full(9, 0.7), np.random.default_rng(1))
    present = np.arange(9) % 3 != 1
    frames = Frames(readings, time_s=STEP * np.arange(9.0), object_present=present)
    result = track(sensor, scene, frames)
    assert (result.present[~present] == 0.0).all()
    assert (result.present[present] > 0.99).all()
    # readings of an object where none is said to be do not fit
    assert result.surprise[1] > result.surprise[0]


def test_gaps_and_dropped_frames_widen_the_prediction_and_nothing_else() -> None:
    """Irregular times, a gap of two seconds in which the object may have moved."""
    settings = TrackingSettings(rate_sd=0.5, visit_s=1e4)
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    rng = np.random.default_rng(2)
    u, _ = wander(rng, 300, settings, (np.log(0.6), 0.1), 0.01)
    kept = np.sort(rng.choice(np.r_[0:60, 260:300], 70, replace=False))
    times = 0.01 * np.arange(300.0)
    readings = read(sensor, scene, np.exp(u), rng)
    result = track(sensor, scene, Frames(readings[kept], time_s=times[kept]), settings)
    assert (result.status == Status.UNIQUE).all()
    assert np.abs(off(result, u[kept])).max() < 5.5
    assert not result.misfit.any()


def test_saturated_frames_are_predicted() -> None:
    settings = TrackingSettings(rate_sd=0.5)
    sensor = parse_sensor({**sensor_of(SNR_100).model_dump(), "full_scale": [1.0, 0.05]})
    scene = scene_of(PLATE)
    rng = np.random.default_rng(3)
    u, _ = wander(rng, 60, settings, (np.log(0.8), 0.0), 0.01)
    readings = read(sensor, scene, np.exp(u), rng)
    readings[20:30, 1] = 0.05
    result = track(sensor, scene, frames_of(readings, 0.01), settings)
    saturated = np.arange(60) // 10 == 2
    assert np.array_equal(result.status == Status.SATURATED, saturated)
    assert np.isfinite(result.best_m).all()
    assert np.isnan(result.range_m[saturated]).all()
    assert (np.diff(result.best_sd_m[19:30]) > 0).all()
    assert np.abs(off(result, u)).max() < 5.5
    first = track(sensor, scene, frames_of(readings[20:25], 0.01), settings)
    assert (first.status == Status.SATURATED).all()
    assert first.present == pytest.approx(0.5, abs=1e-6)


def test_a_sine_wave_beyond_its_wrap_keeps_the_true_one() -> None:
    """At 100 MHz the phase wraps every 1.5 m; the amplitude says nothing, the way there does."""
    settings = TrackingSettings(rate_sd=0.5)
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 1e8, "noise": {"read": [2e-6, 2e-6], "relative": 1.0}}
    )
    scene = scene_of(PLATE, range_m={"prior": "loguniform", "low": 0.2, "high": 4.4})
    ranges = np.exp(np.linspace(np.log(0.5), np.log(3.0), 300))
    rng = np.random.default_rng(9)
    near = scene_of(PLATE, object={**PLATE["object"]})
    readings = read(sensor, near, ranges, rng) * np.exp(0.3 * rng.standard_normal((300, 1)))
    result = track(sensor, scene, frames_of(readings), settings)
    assert np.abs(off(result, np.log(ranges))).max() < 6
    alone = tracker(sensor, scene, settings)
    _, cold = step(alone, alone.first, frames_of(readings[-1:]))
    # a single frame at the end cannot tell
    assert cold.status[0] == Status.AMBIGUOUS
    assert (cold.hypotheses_weight[0] > 0).sum() >= 2


def test_a_jump_beside_its_path_is_not_taken_for_an_outlier_alone() -> None:
    """A step of 5 % in 0.02 s, and on from there.

    The frame was an outlier with a probability of 0.99, and the range that was said to be the only
    one, nine standard deviations off, was where the object had been.
    """
    sensor, scene = sensor_of(1e-3), scene_of(PLATE)
    way = np.r_[np.linspace(0.50, 0.503, 10), np.linspace(0.525, 0.528, 10)]
    frames = frames_of(read(sensor, scene, way, np.random.default_rng(0)))
    found = track(sensor, scene, frames)
    one = found.status == Status.UNIQUE
    assert (np.abs(found.best_m - way)[one] < 5 * found.best_sd_m[one]).all()
    assert one[:10].all()
    assert one[12:].all()
    assert found.status[10] == Status.AMBIGUOUS
    assert np.nanmin(np.abs(found.hypotheses_m[10] / way[10] - 1.0)) < 0.01


def test_an_outlier_is_passed_over() -> None:
    sensor, scene = sensor_of(SNR_100 / 10), scene_of(PLATE)
    readings = read(sensor, scene, np.full(40, 0.7), np.random.default_rng(10))
    readings[20] = [1e9, -1e9]
    result = track(sensor, scene, frames_of(readings))
    assert result.outlier[20] > 0.99
    assert (result.outlier[np.arange(40) != 20] < 0.5).all()
    assert (result.present > 0.9).all()
    assert np.abs(off(result, np.full(40, np.log(0.7)))).max() < 5.5
    assert not result.misfit.any()
    # a scene that is wrong is another matter
    wrong = track(sensor, scene_of(PLATE, crosstalk=[0.0, 0.003]), frames_of(readings))
    assert wrong.misfit.any()


def test_a_stroke_is_a_support_and_a_static_object_stands_still() -> None:
    sensor = sensor_of(SNR_100)
    stroke = scene_of(PLATE, range_m={"prior": "stroke", "low": 0.2, "high": 2.0})
    model = tracker(sensor, stroke)
    assert np.exp(model.model.table.start) == pytest.approx(0.2)
    static = scene_of(PLATE, motion="static")
    readings = read(sensor, static, np.full(100, 0.7), np.random.default_rng(1))
    result = track(sensor, static, frames_of(readings), TrackingSettings(visit_s=1e6))
    assert np.abs(result.rate_m_s).max() == 0.0
    assert result.best_sd_m[-1] == pytest.approx(result.best_sd_m[0] / 10, rel=0.05)
