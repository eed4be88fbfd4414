"""What a stream shares from frame to frame: crosstalk, an uncertain scene, errors of the model."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from inference.estimate import estimate
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from simulator.discrepancy import DISCREPANCY_SD, discrepancy_basis
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import log_slope
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.tracking.scenes import PLATE, STEP, frames_of, read, scene_of, sensor_of, wander
from tests.tracking.tracks import NORMAL, SNR_100, off


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


@pytest.mark.parametrize(("kind", "snr"), [("sine_wave", 1e5), ("pulsed", 1e6)])
def test_an_object_exactly_as_stated_is_no_outlier(kind: str, snr: float) -> None:
    """Its readings are as expected to a noise, where errors of the model may be thousands of it."""
    r = np.full(60, 0.158)
    scene = parse_scene({"object": PLATE["object"]})
    light = read(sensor_of(1e-4, kind), scene, r, np.random.default_rng(1)).max()
    sensor = sensor_of(float(light / snr), kind)
    frames = frames_of(read(sensor, scene, r, np.random.default_rng(2)))
    found = track(sensor, scene, frames)
    assert found.outlier.max() < 0.01
    assert not found.misfit.any()
    assert np.abs((found.range_m - r) / found.sd_m).max() < 5.0
