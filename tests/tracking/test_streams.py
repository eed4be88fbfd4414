"""Objects that come and go, gaps, saturation, drifting crosstalk, uncertain scenes, bad input."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.estimate import estimate
from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import state_from_bytes
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from simulator.discrepancy import DISCREPANCY_SD, discrepancy_basis
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import log_slope
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import mean_readings
from tests.tracking.scenes import FOLDED, PLATE, STEP, frames_of, read, scene_of, sensor_of, wander

Array = NDArray[np.float64]

SNR_100 = 7.72e-5  # noise at which the plate at 1 m has a signal-to-noise ratio of 100
NORMAL = {"prior": "normal", "mean": 0.0}


def off(result: Any, u: Array) -> Array:
    """Errors of the best ranges in units of their standard deviation."""
    return np.asarray((np.log(result.best_m) - u) * result.best_m / result.best_sd_m)


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


def test_crosstalk_that_drifts_is_learnt_where_it_is_asked_for() -> None:
    """It walks by ten deviations of a reading; without the extra state this is a misfit."""
    sensor = sensor_of(SNR_100)
    settings = TrackingSettings(rate_sd=0.5, crosstalk_drift=(3 * SNR_100, 3 * SNR_100))
    rng = np.random.default_rng(4)
    u = np.log(0.5) + 0.5 * np.sin(STEP * np.arange(600.0))
    ranges = np.exp(u)
    ranges[100:140] = np.inf
    ranges[350:360] = np.inf
    scene = scene_of(PLATE, crosstalk=[0.001, 0.002])
    walk = np.cumsum(rng.standard_normal((600, 2)), axis=0) * 3 * SNR_100 * np.sqrt(STEP)
    readings = read(sensor, scene, ranges, rng) + walk
    truth = np.array([0.001, 0.002]) + walk
    result = track(sensor, scene, frames_of(readings), settings)
    assert result.crosstalk is not None
    assert result.crosstalk_sd is not None
    # at the first frame it is known
    errors = (result.crosstalk[1:] - truth[1:]) / result.crosstalk_sd[1:]
    assert (result.crosstalk_sd[0] == 0.0).all()
    assert np.abs(errors).max() < 5.5
    # absence shows it to within a frame's noise
    assert (result.crosstalk_sd[110:140] < 1.5 * SNR_100).all()
    there = np.isfinite(ranges)
    assert np.abs(off(result, u)[there]).max() < 5.5
    assert not result.misfit.any()
    plain = track(sensor, scene, frames_of(readings), TrackingSettings(rate_sd=0.5))
    assert plain.crosstalk is None
    assert plain.misfit.any()


def test_unknown_crosstalk_is_learnt_from_its_prior() -> None:
    sensor = sensor_of(SNR_100)
    scene = scene_of(PLATE, crosstalk=[{**NORMAL, "sd": 0.01}] * 2)
    truth = scene_of(PLATE, crosstalk=[0.004, -0.006])
    ranges = np.exp(np.linspace(np.log(0.3), np.log(1.0), 200))
    readings = read(sensor, truth, ranges, np.random.default_rng(5))
    result = track(sensor, scene, frames_of(readings))
    assert result.crosstalk is not None
    assert result.crosstalk_sd is not None
    assert (np.abs(result.crosstalk[-1] - [0.004, -0.006]) < 5 * result.crosstalk_sd[-1]).all()
    assert (result.crosstalk_sd[-1] < 0.1 * result.crosstalk_sd[0]).all()
    assert np.abs(off(result, np.log(ranges))[-1]) < 5


@pytest.mark.parametrize("observables", ["w2", "readings"])
@pytest.mark.parametrize("spread", [0.05, 0.2])
def test_an_uncertain_scene_does_not_average_down(spread: float, observables: Any) -> None:
    """Draws of c0 and c2; the object stands still for 100 frames. Two bands of 1 in 10,000 each.

    Whatever the number of frames, the error that the scene causes stays; what the noise adds goes.
    """
    count = 200
    sensor = sensor_of(SNR_100 / 10)
    unknown = {
        "c0": {"prior": "lognormal", "median": 0.0769, "sigma": spread},
        "c1": -0.123,
        "c2": {"prior": "lognormal", "median": 0.0957, "sigma": spread},
    }
    scene = scene_of(PLATE, object=unknown)
    parameters = parameters_of(sensor, scene)
    rng = np.random.default_rng(6)
    draws = parameters.natural(parameters.sample(rng, 2000))
    settings = TrackingSettings(observables=observables, rate_sd=0.1, outlier=1e-9)
    model = tracker(sensor, scene, settings, draws)
    errors = []
    q = 0.7 * (0.7 - 0.123) + 0.0769
    slope = log_slope(0.7, 0.0769, -0.123)
    expected = spread * np.hypot(1.0, 1.0 - 0.0769 / q) / -slope
    for c0, c2 in draws[:count]:
        truth = scene_of(PLATE, object={"c0": c0, "c1": -0.123, "c2": c2})
        readings = read(sensor, truth, np.full(100, 0.7), rng)
        _, result = step(model, model.first, frames_of(readings))
        errors.append(off(result, np.full(100, np.log(0.7)))[-1])
        if observables == "readings":  # w1 / w2 does not feel c0 and c2
            assert result.best_sd_m[-1] < 0.3 * expected * result.best_m[-1]
            continue
        # what c0 and c2 do to the range at a given w2
        assert result.best_sd_m[-1] > 0.98 * expected * result.best_m[-1]
        assert result.sd_parts_m.scene[-1] > 0.98 * expected * result.best_m[-1]
        assert not result.misfit.any()
    low, high = stats.binom.interval(1 - 1e-4, count, 0.9)
    assert low <= np.sum(np.abs(errors) < stats.norm.isf(0.05)) <= high
    assert stats.chi2.ppf(5e-5, count) < np.sum(np.square(errors)) < stats.chi2.isf(5e-5, count)


def test_a_smooth_discrepancy_widens_and_stays() -> None:
    sensor = sensor_of(SNR_100)
    plain, wrong = scene_of(PLATE), scene_of(PLATE, discrepancy=0.05)
    readings = read(sensor, plain, np.full(200, 0.7), np.random.default_rng(7))
    known = track(sensor, plain, frames_of(readings))
    result = track(sensor, wrong, frames_of(readings))
    # w1 / w2 does not feel it: it bounds what a relative error of the flux can do
    assert result.best_sd_m[-1] > 3 * known.best_sd_m[-1]
    assert result.sd_parts_m.model[-1] > 0.5 * result.best_sd_m[-1]
    positions = np.linspace(np.log(0.1), np.log(3.0), 50)
    shapes = 0.05 * discrepancy_basis(0.1, 3.0, 1e-3).values(positions)
    lag = np.sqrt(5.0) * np.abs(positions[:, None] - positions[None, :])
    wanted = 0.05**2 * (1 + lag + lag**2 / 3) * np.exp(-lag)
    # a thousandth of the variance is left out, more of it at the ends
    assert np.abs(shapes @ shapes.T - wanted).max() < 0.02 * 0.05**2


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_errors_of_the_model_do_not_average_down(kind: str) -> None:
    """90 % intervals after 40 frames, on 200 tracks each with smooth errors of its own.

    The band fails by chance once in 10,000; the tracker is told nothing of errors, which are then
    the measured ones.
    """
    from simulator.simulate import simulate
    from simulator.trajectories import SampledTrajectory

    count = 200
    sizes = {"flux": FITTED_SHARE * DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}
    sensor, erring = sensor_of(SNR_100, kind), scene_of(PLATE, discrepancy=sizes)
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-9)
    model = tracker(sensor, parse_scene(PLATE), settings)
    rng = np.random.default_rng(12)
    errors, rates = [], []
    for _ in range(count):
        u, v = wander(rng, 40, settings, (rng.uniform(np.log(0.3), np.log(1.2)), 0.0))
        path = SampledTrajectory(range_m=np.exp(u).tolist(), time_s=(STEP * np.arange(40)).tolist())
        _, result = step(model, model.first, simulate(sensor, erring, path, rng).frames)
        errors.append(off(result, u)[-1])
        rates.append((result.rate_m_s[-1] - v[-1] * np.exp(u[-1])) / result.rate_sd_m_s[-1])
        parts = [part[-1] for part in result.sd_parts_m]
        assert math.hypot(*parts) == pytest.approx(result.best_sd_m[-1], rel=1e-6)
        assert parts[2] > RANGE_ERROR_SD / 2
        assert not result.misfit.any()
    low, high = stats.binom.interval(1 - 1e-4, count, 0.9)
    assert low <= np.sum(np.abs(errors) < stats.norm.isf(0.05)) <= high
    assert low <= np.sum(np.abs(rates) < stats.norm.isf(0.05)) <= high


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_derivatives_owe_to_errors_of_the_model_what_the_technique_says(kind: str) -> None:
    """The direction of a derivative is the same equation in `differential`."""
    sensor = sensor_of(SNR_100, kind, noise={"derivative": [1e-5, 1e-5]})
    scene = parse_scene(PLATE)
    model = tracker(sensor, scene, TrackingSettings(observables="derivatives"))
    ranges = np.array([0.3, 0.6, 1.1])
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    ends = [mean_readings(sensor, terms, ranges + side) for side in (1e-6, -1e-6)]
    rates = (ends[0] - ends[1]) / 2e-6
    alone = estimate(sensor, scene, Frames(rates, derivatives=rates), ["differential"]).results[0]
    assert alone.sd_parts_m is not None
    found = ranges * model.added(np.log(ranges))
    np.testing.assert_allclose(found, alone.sd_parts_m.model[:, 0], rtol=0.01)


@pytest.mark.parametrize("noise", [{"shot": 1e-6}, {"relative": 0.02}])
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_noise_that_grows_with_the_signal(kind: str, noise: dict[str, float]) -> None:
    """90 % intervals of 200 tracks of ten frames; the band fails by chance once in 10,000."""
    from simulator.simulate import simulate
    from simulator.trajectories import SampledTrajectory

    count = 200
    sensor, scene = sensor_of(SNR_100, kind, noise=noise), scene_of(PLATE)
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-9)
    model = tracker(sensor, scene, settings)
    rng = np.random.default_rng(8)
    errors = []
    for _ in range(count):
        u, _ = wander(rng, 10, settings, (rng.uniform(np.log(0.3), np.log(1.5)), 0.0))
        path = SampledTrajectory(range_m=np.exp(u).tolist(), time_s=(STEP * np.arange(10)).tolist())
        _, result = step(model, model.first, simulate(sensor, scene, path, rng).frames)
        errors.append(off(result, u)[-1])
    low, high = stats.binom.interval(1 - 1e-4, count, 0.9)
    assert low <= np.sum(np.abs(errors) < stats.norm.isf(0.05)) <= high


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
        ({"object": {"c0": 0.1, "c1": 0.0}}, {}, "object.c2"),
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
