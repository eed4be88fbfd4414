"""Crosstalk that is learnt on the way: neither forgotten nor known better than it can be."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from simulator.frames import Frames, frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor

C0, C1, C2 = 0.0769, -0.123, 0.0957
READ = 8e-5
STEP = 0.02
Array = NDArray[np.float64]

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [READ, READ]}})
QUIET = TrackingSettings(visit_s=1e5, absence_s=1e5, rate_sd=0.3)


def scene_of(sd: float, **more: Any) -> dict[str, Any]:
    return {
        "object": {"c0": C0, "c1": C1, "c2": C2},
        "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": sd}] * 2,
        "range_m": {"prior": "loguniform", "low": 0.2, "high": 3.0},
        "discrepancy": 0,
        **more,
    }


def flux(r: Array) -> Array:
    return np.asarray(C0 * C2 / (r**2 * (r**2 + C1 * r + C0)))


def frames_at(r: Array, crosstalk: Array, rng: np.random.Generator) -> Frames:
    assert isinstance(SENSOR, PulsedSensor)
    light = flux(r)
    w = np.column_stack([light * r / SENSOR.r0, light]) + crosstalk
    w += READ * rng.standard_normal(w.shape)
    time = STEP * np.arange(r.size)
    return frames_from_columns(SENSOR, {"time_s": time, "w1": w[:, 0], "w2": w[:, 1]})


def wandering(rng: np.random.Generator, frames: int) -> Array:
    """A path of the filter's own law, within 0.3 and 1.5 m."""
    while True:
        rate, u = rng.normal(0.0, 0.3), np.log(rng.uniform(0.5, 1.0))
        decay = np.exp(-STEP / QUIET.rate_time_s)
        path = []
        for _ in range(frames):
            path.append(u)
            u += STEP * rate
            rate = decay * rate + np.sqrt(1.0 - decay**2) * rng.normal(0.0, 0.3)
        if np.log(0.3) < min(path) and max(path) < np.log(1.5):
            return np.exp(path)


def test_intervals_hold_the_truth_while_the_object_moves() -> None:
    """90 % intervals after 150 frames: fewer than 24 of 40 once in 1e3 runs if 80 % hold it.

    Four of five is what a filter that is linear at each step reaches here. One that takes the turns
    of its tangents for knowledge holds 11.
    """
    assert stats.binom.cdf(23, 40, 0.8) < 2e-3
    model = tracker(SENSOR, parse_scene(scene_of(1e-3)), QUIET)
    held = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        r = wandering(rng, 150)
        _, found = step(model, model.first, frames_at(r, 1e-3 * rng.standard_normal(2), rng))
        held += bool(abs(found.best_m[-1] - r[-1]) < 1.645 * found.best_sd_m[-1])
    assert held >= 24


@pytest.mark.parametrize("discrepancy", [0, "default"])
def test_crosstalk_far_above_the_noise_loses_no_track(discrepancy: float | str) -> None:
    """Crosstalk unknown by 125 read noises, which is half of the object's own light at 0.8 m.

    Taken for a straight line, what follows it was 65 standard deviations off in one of 12 tracks,
    and held 64 %. Errors of a track go together: five standard deviations at every frame of 12
    tracks, and 70 % of the 90 % intervals, are what is asked; 86 and 87 % hold.
    """
    sd, held = 1e-2, []
    model = tracker(SENSOR, parse_scene(scene_of(sd, discrepancy=discrepancy)), QUIET)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        r = wandering(rng, 150)
        _, found = step(model, model.first, frames_at(r, sd * rng.standard_normal(2), rng))
        unique = np.isfinite(found.range_m)
        z = (found.range_m - r)[unique] / found.sd_m[unique]
        assert np.abs(z).max(initial=0.0) < 5.0
        held.append(np.mean(np.abs(z) < 1.645))
    assert np.mean(held) > 0.7


def test_an_object_far_slower_than_stated_is_followed_by_few_hypotheses_as_by_many() -> None:
    """A percent of its range a second, where e-folds a second are possible, in very clear light.

    Taken for corrections, its motion turned the crosstalk, until every frame was an outlier: two of
    six tracks said misfit, one was lost for good with four hypotheses and not with 3 or 12. Errors
    of a track go together: five standard deviations at every frame are what is asked.
    """
    assert isinstance(SENSOR, PulsedSensor)
    noise, sd, frames = np.array([5e-7, 8e-6]), np.array([6e-4, 1.2e-2]), 400
    told = {"prior": "normal", "mean": 0.0}
    scene = parse_scene(scene_of(1.0, crosstalk=[told | {"sd": float(part)} for part in sd]))
    sensor = SENSOR.model_copy(
        update={"noise": SENSOR.noise.model_copy(update={"read": tuple(noise.tolist())})}
    )
    time = 0.01 * np.arange(frames)
    r = 0.21 * np.exp(0.0115 * time)
    light = np.column_stack([flux(r) * r / SENSOR.r0, flux(r)])
    models = [tracker(sensor, scene, TrackingSettings(hypotheses=n)) for n in (2, 4, 12)]
    for seed in range(6):
        rng = np.random.default_rng(seed)
        w = light + sd * rng.standard_normal(2) + noise * rng.standard_normal((frames, 2))
        made = frames_from_columns(sensor, {"time_s": time, "w1": w[:, 0], "w2": w[:, 1]})
        best = []
        for model in models:
            _, found = step(model, model.first, made)
            z = (found.range_m - r) / found.sd_m
            assert np.mean(np.isfinite(z)) > 0.98
            assert np.nanmax(np.abs(z)) < 5.0
            assert not found.misfit.any()
            best.append(z[-1])
        # which hypotheses there is room for is no knowledge
        assert np.ptp(best) < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_an_object_at_rest_from_the_first_frame_is_not_taken_for_crosstalk(seed: int) -> None:
    """Nothing tells them apart until it moves; then its ranges are right.

    The least of 4 x 200 errors beyond 4.9 standard deviations has a chance of 1e-3.
    """
    rng = np.random.default_rng(seed)
    path = 0.8 * np.exp(0.5 * np.sin(0.8 * np.maximum(STEP * np.arange(350) - 3.0, 0.0)))
    truth = np.array([0.05, 0.1])
    scene = parse_scene(scene_of(0.5))
    moves = TrackingSettings(rate_sd=1.0)
    answer = track(SENSOR, scene, frames_at(path, truth, rng), moves)
    assert 0.1 < answer.present[149] < 0.9
    assert answer.crosstalk is not None
    assert answer.crosstalk_sd is not None
    for frame in (50, 149):
        off = (answer.crosstalk[frame] - truth) / answer.crosstalk_sd[frame]
        assert np.abs(off).max() < 10.0  # a mixture of the two, far from normal
    z = (answer.range_m - path)[150:] / answer.sd_m[150:]
    assert np.isfinite(z).mean() > 0.8
    assert np.nanmax(np.abs(z)) < 4.9
    assert not answer.misfit.any()


@pytest.mark.parametrize("motion", ["static", "radial"])
def test_frames_of_an_object_at_rest_do_not_tell_range_from_crosstalk(motion: str) -> None:
    """The exact posterior of the one range, on a grid, does not get narrower than a percent."""
    assert isinstance(SENSOR, PulsedSensor)
    sd, n = 1e-3, 200
    model = tracker(SENSOR, parse_scene(scene_of(sd, motion=motion)), QUIET)
    rng = np.random.default_rng(3)
    frames = frames_at(np.full(n, 0.8), sd * rng.standard_normal(2), rng)
    _, found = step(model, model.first, frames)
    u = np.linspace(np.log(0.2), np.log(3.0), 20_001)
    light = flux(np.exp(u))
    mean = frames.readings.mean(axis=0)
    misses = (mean[0] - light * np.exp(u) / SENSOR.r0) ** 2 + (mean[1] - light) ** 2
    density = np.exp(-0.5 * (misses - misses.min()) / (sd**2 + READ**2 / n))
    density /= density.sum()
    exact = np.sqrt(density @ u**2 - (density @ u) ** 2)
    relative = found.best_sd_m / found.best_m
    # the posterior is a little skew: a standard deviation at its mode is not quite that
    np.testing.assert_allclose(relative[[0, 9, n - 1]], exact, rtol=0.15)


@pytest.mark.parametrize("discrepancy", [None, 0.002, 0.02])
def test_a_discrepancy_does_not_make_crosstalk_known(discrepancy: float | None) -> None:
    rng = np.random.default_rng(0)
    r = 0.8 + 0.3 * np.sin(STEP * np.arange(150))
    more = {} if discrepancy is None else {"discrepancy": discrepancy}
    scene = parse_scene(scene_of(1e-3, **more))
    found = track(SENSOR, scene, frames_at(r, np.array([0.0, 1e-3]), rng), QUIET)
    assert found.crosstalk_sd is not None
    # the first frame tells nothing of the whole window's crosstalk: its prior, or a little more for
    # the parts into which what follows it is divided
    assert 0.95e-3 < found.crosstalk_sd[0, 1] < 1.1e-3
    z = (found.best_m - r) / found.best_sd_m
    # errors of a track go together: five standard deviations at every frame is what is asked
    assert np.nanmax(np.abs(z)) < 5.0


@pytest.mark.parametrize("seed", range(4))
def test_crosstalk_known_to_the_noise_takes_up_no_error_of_the_model(seed: int) -> None:
    """A near object whose light errs by hundreds of read noises, crosstalk known to 1.25 of them.

    What its range errs with the crosstalk is told by the late window. Of the whole one, crosstalk
    was let go 40 standard deviations off to keep an error that no frame had told, and where both
    erred along one line, by hundreds of read noises in a frame; ranges were up to 52 off.
    """
    sd = 1.25 * READ
    scene = parse_scene(scene_of(sd, discrepancy="default"))
    rng = np.random.default_rng(seed)
    r = 0.24 * np.exp(1.15 * np.linspace(0.0, 1.0, 300) ** 2)
    crosstalk = sd * rng.standard_normal(2)
    found = track(SENSOR, scene, frames_at(r, crosstalk, rng), QUIET)
    assert found.crosstalk is not None
    assert found.crosstalk_sd is not None
    # with what its correlation with the model's error adds to it
    assert (found.crosstalk_sd < 1.3 * sd).all()
    # errors of a track go together: five standard deviations at every frame is what is asked
    assert (np.abs(found.crosstalk - crosstalk) < 5.0 * found.crosstalk_sd).all()
    assert (np.abs(found.best_m - r) < 5.0 * found.best_sd_m).all()


def test_an_object_that_may_be_anywhere_after_a_step_is_found_again() -> None:
    """Half a second at three e-folds a second, crosstalk unknown: tracks were lost for good.

    One was 555 standard deviations off after 60 frames. Errors of a track go together: of six
    tracks five standard deviations at every frame are what is asked.
    """
    scene = parse_scene(scene_of(3e-3))
    settings = TrackingSettings(rate_sd=3.0)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        r = 0.8 * np.exp(0.5 * np.sin(0.9 * np.arange(120) + seed))
        readings = frames_at(r, 3e-3 * rng.standard_normal(2), rng).readings
        found = track(SENSOR, scene, Frames(readings, time_s=0.5 * np.arange(120.0)), settings)
        z = (found.best_m - r) / found.best_sd_m
        assert np.nanmax(np.abs(z[60:])) < 5.0


def test_shot_noise_counts_with_one_window_alone() -> None:
    """Standardised errors: the mean square of 300 independent ones is below 1.5 in all but 1e-8."""
    assert isinstance(SENSOR, PulsedSensor)
    noise = {"read": [1e-5, 1e-5], "shot": 1e-4}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    scene = parse_scene({"object": {"c0": C0, "c1": C1, "c2": C2}, "discrepancy": 0})
    rng = np.random.default_rng(1)
    r = 0.6 + 0.2 * np.sin(0.5 * STEP * np.arange(300))
    light = flux(r)
    w1 = light * r / SENSOR.r0
    w1 = w1 + np.sqrt(1e-10 + 1e-4 * w1) * rng.standard_normal(r.size)
    frames = frames_from_columns(
        sensor, {"time_s": STEP * np.arange(r.size), "w1": w1, "w2": light}
    )
    found: Track = track(sensor, scene, frames, TrackingSettings(observables="w1", rate_sd=0.3))
    z = (found.best_m - r) / found.best_sd_m
    assert np.nanmean(z**2) < 1.5
    assert not found.misfit.any()
