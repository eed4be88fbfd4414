"""The tracker against slow references, and what it promises of streams."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg, stats

from inference.estimates import SdParts, Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import state_from_bytes, state_to_bytes
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.simulate import mean_readings
from tests.tracking.reference import GridFilter
from tests.tracking.scenes import (
    FOLD_M,
    FOLDED,
    PLATE,
    STEP,
    frames_of,
    read,
    scene_of,
    sensor_of,
    wander,
)

Array = NDArray[np.float64]

SNR_1000 = 7.72e-6  # noise at which the plate at 1 m has a signal-to-noise ratio of 1000


def below(result: Track, u: float) -> Array:
    """Probability of a range below exp(u) given that an object is there, of every frame."""
    z = (u - np.log(result.hypotheses_m)) / (result.hypotheses_sd_m / result.hypotheses_m)
    weight = np.nan_to_num(result.hypotheses_weight)
    total = np.maximum(weight.sum(axis=1), 1e-300)  # without hypotheses there is nothing to say
    return np.asarray((weight * np.nan_to_num(stats.norm.cdf(z))).sum(axis=1) / total)


def assert_same(one: Track, other: Track) -> None:
    """Assert that two results agree to the last bit."""
    for field in dataclasses.fields(Track):
        left, right = getattr(one, field.name), getattr(other, field.name)
        if left is None or right is None:
            assert left is right
        elif isinstance(left, SdParts):
            np.testing.assert_array_equal(np.stack(left), np.stack(right))
        else:
            width = min(left.shape[1:], right.shape[1:])[:1]
            for values in (left, right):  # padding alone may differ
                if width:
                    assert np.isnan(values[:, width[0] :]).all()
            if width:
                left, right = left[:, : width[0]], right[:, : width[0]]
            np.testing.assert_array_equal(left, right)


def joined(parts: list[Track]) -> Track:
    """Put batches together."""
    columns: dict[str, Any] = {}
    for field in dataclasses.fields(Track):
        values = [getattr(part, field.name) for part in parts]
        if values[0] is None:
            columns[field.name] = None
            continue
        if isinstance(values[0], SdParts):
            columns[field.name] = SdParts(*map(np.concatenate, zip(*values, strict=True)))
            continue
        if values[0].ndim == 2:
            width = max(value.shape[1] for value in values)
            values = [
                np.pad(v, ((0, 0), (0, width - v.shape[1])), constant_values=np.nan) for v in values
            ]
        columns[field.name] = np.concatenate(values)
    return Track(**columns)


@pytest.mark.parametrize("noise", [2e-5, 1e-4])
def test_weights_of_both_branches_are_those_of_a_grid_filter(noise: float) -> None:
    """One reading, two roots: the object crosses the fold or turns back, and only its rate tells.

    The filter keeps Gaussians where the grid keeps everything, so that it may differ at the fold by
    some per cent (and the grid has cells); without a memory of the rate it would be off by 0.5.
    """
    settings = TrackingSettings(observables="w2", rate_sd=0.5, outlier=1e-9)
    sensor, scene = sensor_of(noise), scene_of(FOLDED)
    model = tracker(sensor, scene, settings)
    rng = np.random.default_rng(5)
    fold = np.log(FOLD_M)
    differences, centres = [], []
    for side in (-1.0, 1.0):
        u, _ = wander(rng, 60, settings, (fold + 0.2 * side, -0.4 * side))
        readings = read(sensor, scene, np.exp(u), rng)
        _, result = step(model, model.first, frames_of(readings))
        grid = GridFilter(sensor, scene, settings, (0.2, 2.9), cells=1024, rates=41)
        exact = []
        for i, pair in enumerate(readings):
            if i:
                grid.move(STEP)
            grid.see(pair)
            exact.append(grid.below(fold))
            centres.append(np.log(result.best_m[i]) - u[i])
        differences.append(np.abs(below(result, fold) - exact))
    assert np.mean(differences) < 0.02
    assert np.max(differences) < 0.15


@pytest.mark.parametrize(
    ("discrepancy", "noise"), [(0, 8e-5), ("default", 8e-5), (0, 7.7e-6)], ids=str
)
def test_smooth_motion_through_a_fold_is_not_sure_of_a_wrong_branch(
    discrepancy: float | str, noise: float
) -> None:
    """Three ranges explain one window of a steady object that passes the turning point at 0.158 m.

    The flatter branch is likelier in every frame by the same few per cent as long as the motion is
    as rough as stated: of steady motion it was sure, at the wrong range. At the least noise both
    ranges at the fold lie between the same two knots, and one of them was not looked for.
    """
    sensor = sensor_of(noise)
    folded = {"c0": 0.0769, "c1": -0.535, "c2": 0.0957}
    scene = scene_of({"object": folded, "discrepancy": discrepancy})
    model = tracker(sensor, scene, TrackingSettings(observables="w2"))
    ranges = np.linspace(0.2, 0.1, 151)
    for seed in range(3):
        readings = read(sensor, scene, ranges, np.random.default_rng(seed))
        _, result = step(model, model.first, frames_of(readings))
        away = np.abs(result.range_m - ranges) / result.sd_m
        assert not (away > 5.0).any()
        near = np.abs(result.hypotheses_m - ranges[:, None]) < 5.0 * result.hypotheses_sd_m
        # no branch is known, and none is lost: neither is below one in twenty but at the fold
        weight = np.where(near, result.hypotheses_weight, 0.0).sum(axis=1)
        assert weight[[60, 75]].min() > 0.05


def test_presence_and_range_are_those_of_a_grid_filter() -> None:
    """A weak object comes and goes: signal-to-noise 10 at 1 m."""
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-9, visit_s=3.0, absence_s=3.0)
    sensor, scene = sensor_of(7.72e-4), scene_of(PLATE)
    rng = np.random.default_rng(2)
    u, _ = wander(rng, 60, settings, (0.2, 0.3))
    ranges = np.where(np.arange(60) % 40 < 25, np.exp(u), np.inf)
    readings = read(sensor, scene, ranges, rng)
    result = track(sensor, scene, frames_of(readings), settings)
    grid = GridFilter(sensor, scene, settings, (0.1, 3.0), cells=1024, rates=41)
    for i, pair in enumerate(readings):
        if i:
            grid.move(STEP)
        grid.see(pair)
        assert result.present[i] == pytest.approx(grid.present, abs=0.05)
        if grid.present > 0.9 and result.status[i] == Status.UNIQUE:
            mean, sd = grid.moments()
            assert np.log(result.best_m[i]) == pytest.approx(mean, abs=0.3 * sd)
            assert result.best_sd_m[i] / result.best_m[i] == pytest.approx(sd, rel=0.2)


def test_one_mode_is_an_extended_kalman_filter() -> None:
    """Textbook matrices, linearised at the mode; what differs is of second order in the noise."""
    sensor = sensor_of(SNR_1000 / 10)
    scene = scene_of(PLATE, range_m={"prior": "loguniform", "low": 0.1, "high": 14.0})
    settings = TrackingSettings(rate_sd=0.3)
    rng = np.random.default_rng(4)
    u, _ = wander(rng, 100, settings, (np.log(0.8), 0.2))
    readings = read(sensor, scene, np.exp(u), rng)
    result = track(sensor, scene, frames_of(readings), settings)
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    s, tau = settings.rate_sd, settings.rate_time_s

    def means(at: float) -> Array:
        return np.asarray(mean_readings(sensor, terms, np.exp(np.array([at])))[0])

    drift = np.array([[0.0, 1.0], [0.0, -1.0 / tau]])
    block = np.block([[-drift, np.diag([0.0, 2 * s * s / tau])], [np.zeros((2, 2)), drift.T]])
    block = linalg.expm(block * STEP)
    F = block[2:, 2:].T
    Q = F @ block[:2, 2:]
    R = np.diag(np.square(sensor.noise.read))
    x, P = np.array([u[0], 0.0]), np.diag([1.0, s * s])
    for i, pair in enumerate(readings):
        if i:
            x, P = F @ x, F @ P @ F.T + Q
        at = x[0]
        for _ in range(20):
            H = np.zeros((2, 2))
            H[:, 0] = (means(at + 1e-6) - means(at - 1e-6)) / 2e-6
            gain = P @ H.T @ linalg.inv(H @ P @ H.T + R)
            new = x + gain @ (pair - means(at) - H[:, 0] * (x[0] - at))
            at = new[0]
        rest = np.eye(2) - gain @ H
        x, P = new, rest @ P @ rest.T + gain @ R @ gain.T
        sd = np.sqrt(P[0, 0])
        # the skewness of a frame is a few times its standard deviation, 0.003 at most
        assert np.log(result.best_m[i]) == pytest.approx(x[0], abs=0.03 * sd)
        assert result.best_sd_m[i] / result.best_m[i] == pytest.approx(sd, rel=0.01)
        if i:
            rate = result.rate_m_s[i] / result.best_m[i]
            assert rate == pytest.approx(x[1], abs=0.03 * np.sqrt(P[1, 1]))


def errors_at_the_end(
    sensor: Any, scene: Any, settings: TrackingSettings, count: int, seed: int
) -> tuple[Array, Array, int]:
    """Errors of log r and its rate in units of their deviations, one independent track each."""
    model = tracker(sensor, scene, settings)
    rng = np.random.default_rng(seed)
    position, rate, surprising = [], [], 0
    for _ in range(count):
        start = (rng.uniform(np.log(0.3), np.log(1.5)), settings.rate_sd * rng.standard_normal())
        u, v = wander(rng, 15, settings, start)
        readings = read(sensor, scene, np.exp(u), rng)
        _, result = step(model, model.first, frames_of(readings))
        scale = result.best_m[-1]
        position.append((np.log(scale) - u[-1]) / (result.best_sd_m[-1] / scale))
        rate.append((result.rate_m_s[-1] / scale - v[-1]) / (result.rate_sd_m_s[-1] / scale))
        surprising += int(result.misfit.any())
    return np.array(position), np.array(rate), surprising


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_coverage_and_consistency(kind: str) -> None:
    """90 % intervals and squared errors of 300 tracks; each band fails by chance once in 10,000."""
    count = 300
    sensor, scene = sensor_of(SNR_1000 * 10, kind), scene_of(PLATE)
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-9)
    position, rate, surprising = errors_at_the_end(sensor, scene, settings, count, 11)
    low, high = stats.binom.interval(1 - 1e-4, count, 0.9)
    for errors in (position, rate):
        assert low <= np.sum(np.abs(errors) < stats.norm.isf(0.05)) <= high
        assert stats.chi2.ppf(5e-5, count) < errors @ errors < stats.chi2.isf(5e-5, count)
    assert surprising == 0


def test_both_windows_never_take_a_wrong_root() -> None:
    """With w1 and w2 there is one root, also where w2 alone has two: 6,000 frames through it."""
    sensor, scene = sensor_of(1e-4), scene_of(FOLDED)
    settings = TrackingSettings(rate_sd=0.5)
    model = tracker(sensor, scene, settings)
    rng = np.random.default_rng(6)
    for _ in range(30):
        side = rng.choice([-1.0, 1.0])
        u, _ = wander(rng, 200, settings, (np.log(FOLD_M) + 0.2 * side, -0.4 * side), 0.01)
        u = np.clip(u, np.log(0.3), np.log(2.0))
        _, result = step(model, model.first, frames_of(read(sensor, scene, np.exp(u), rng), 0.01))
        off = np.abs(np.log(result.best_m) - u) * result.best_m / result.best_sd_m
        assert (result.status == Status.UNIQUE).all()
        # 6,000 correlated normal errors, one beyond 6.5 in 10^6 runs
        assert off.max() < 6.5


@pytest.mark.parametrize("observables", ["readings", "w2"])
def test_looking_everywhere_finds_nothing_more(observables: Any) -> None:
    """What is not looked for in every frame is, together, lighter than what may be dropped."""
    settings = TrackingSettings(observables=observables, rate_sd=0.5, visit_s=1.0, absence_s=1.0)
    sensor, scene = sensor_of(1e-4), scene_of(FOLDED)
    rng = np.random.default_rng(3)
    u, _ = wander(rng, 300, settings, (np.log(0.8), 0.1))
    ranges = np.exp(np.clip(u, np.log(0.3), np.log(2.0)))
    ranges[100:140] = np.inf
    ranges[200:] = np.flip(ranges[200:])  # another object takes its place
    readings = read(sensor, scene, ranges, rng)
    readings[50] *= 3.0
    model = tracker(sensor, scene, settings)
    _, lazy = step(model, model.first, frames_of(readings))
    _, full = step(model, model.first, frames_of(readings), full=True)
    allowed = 20 * settings.negligible
    assert np.abs(lazy.present - full.present).max() < allowed
    for u_at in np.log([0.4, 0.6, FOLD_M, 1.5]):
        there = full.present > 0.01
        assert np.abs(below(lazy, u_at) - below(full, u_at))[there].max() < allowed / 0.01


def test_a_stream_may_be_cut_anywhere() -> None:
    """Also through bytes, and frame by frame: the same to the last bit."""
    settings = TrackingSettings(observables="w2", rate_sd=0.5, crosstalk_drift=(1e-6, 1e-6))
    sensor, scene = sensor_of(1e-4), scene_of(FOLDED, crosstalk=[0.001, 0.002])
    rng = np.random.default_rng(9)
    u, _ = wander(rng, 80, settings, (np.log(0.8), 0.3))
    frames = frames_of(read(sensor, scene, np.exp(u), rng))
    model = tracker(sensor, scene, settings)
    _, whole = step(model, model.first, frames)
    for cuts in ([1, 2, 50], list(range(1, 80))):
        state, parts = model.first, []
        for index in np.split(np.arange(80), cuts):
            before = state_to_bytes(state)
            state, part = step(model, state_from_bytes(before), frames.select(index))
            parts.append(part)
        assert_same(joined(parts), whole)
    assert_same(track(sensor, scene, frames, settings), whole)


def test_a_step_changes_nothing_that_it_was_given() -> None:
    sensor, scene = sensor_of(1e-4), scene_of(FOLDED)
    model = tracker(sensor, scene)
    before = state_to_bytes(model.first)
    frames = frames_of(read(sensor, scene, np.full(5, 0.7), np.random.default_rng(1)))
    copy = frames.readings.copy()
    step(model, model.first, frames)
    assert state_to_bytes(model.first) == before
    assert np.array_equal(frames.readings, copy)


@pytest.mark.parametrize("scale", [2.0**-40, 2.0**40])
def test_nothing_depends_on_the_unit_of_the_readings(scale: float) -> None:
    scene, scaled = scene_of(FOLDED), {**FOLDED, "background": dict(FOLDED["background"])}
    scaled["background"]["strength"] *= scale
    noise = {"shot": 1e-7, "relative": 0.01}
    sensor = sensor_of(1e-4, noise=noise)
    other = sensor_of(1e-4 * scale, noise={"shot": 1e-7 * scale, "relative": 0.01}, gain=scale)
    frames = frames_of(read(sensor, scene, np.linspace(0.5, 1.5, 40), np.random.default_rng(1)))
    one = track(sensor, scene, frames)
    two = track(other, scene_of(scaled), Frames(frames.readings * scale, time_s=frames.time_s))
    assert_same(one, two)  # powers of two round nothing
