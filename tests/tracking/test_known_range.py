"""Ranges that are known beside the readings, against slow references."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.simulate import mean_readings
from tests.posterior.scenes import UNKNOWN_CROSSTALK
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
from tests.tracking.test_track import assert_same, below, joined

Array = NDArray[np.float64]

NOISE = 7.72e-5  # the plate at 1 m has a signal-to-noise ratio of 100


def known_at(frames: Frames, known: dict[int, tuple[float, float]]) -> Frames:
    """Frames with known ranges, each with its standard deviation, at some of them."""
    value, sd = np.full((2, len(frames)), np.nan)
    for i, (r, own) in known.items():
        value[i], sd[i] = r, own
    return dataclasses.replace(frames, known_range_m=value, known_range_sd_m=sd)


def compared(
    data: dict[str, Any],
    settings: TrackingSettings,
    u: Array,
    noise: float,
    share: float,
    seed: int,
) -> tuple[Track, list[GridFilter]]:
    """Track with every tenth range known to a share of itself; the grid filter of each frame."""
    rng = np.random.default_rng(seed)
    sensor, scene = sensor_of(noise), scene_of(data)
    readings = read(sensor, scene, np.exp(u), rng)
    known = {
        i: (float(np.exp(u[i]) * (1.0 + share * rng.standard_normal())), share * np.exp(u[i]))
        for i in range(0, u.size, 10)
    }
    result = track(sensor, scene, known_at(frames_of(readings), known), settings)
    low, high = data["range_m"]["low"], data["range_m"]["high"]
    grid = GridFilter(sensor, scene, settings, (low, high), cells=1024, rates=41)
    grids = []
    for i, pair in enumerate(readings):
        if i:
            grid.move(STEP)
        grid.see(pair, known.get(i))
        grids.append(dataclasses.replace(grid))
        grids[-1].mass, grids[-1].absent = grid.mass, grid.absent
    return result, grids


@pytest.mark.parametrize("share", [0.3, 0.05])
def test_known_ranges_weigh_the_branches_as_in_a_grid_filter(share: float) -> None:
    """One window of an object that turns near a fold; tolerances as without known ranges."""
    settings = TrackingSettings(observables="w2", rate_sd=0.5, outlier=1e-9)
    fold = np.log(FOLD_M)
    u, _ = wander(np.random.default_rng(5), 40, settings, (fold + 0.25, -0.2))
    result, grids = compared(FOLDED, settings, u, 2e-5, share, 1)
    exact = np.array([grid.below(fold) for grid in grids])
    off = np.abs(below(result, fold) - exact)
    assert off.mean() < 0.02
    assert off.max() < 0.15


def test_ranges_are_those_of_a_grid_filter() -> None:
    """A weak object, and ranges known better than its frames tell them."""
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-9)
    u, _ = wander(np.random.default_rng(2), 40, settings, (0.2, 0.3))
    result, grids = compared(PLATE, settings, u, 7.72e-4, 0.02, 3)
    for i, grid in enumerate(grids):
        mean, sd = grid.moments()
        assert np.log(result.best_m[i]) == pytest.approx(mean, abs=0.3 * sd)
        assert result.best_sd_m[i] / result.best_m[i] == pytest.approx(sd, rel=0.2)
        assert result.present[i] == pytest.approx(grid.present, abs=0.02)
    assert result.present[::10] == pytest.approx(1.0)  # where a range is known an object is


@pytest.mark.parametrize("observables", ["readings", "w2"])
def test_known_ranges_teach_crosstalk(observables: Any) -> None:
    """With its range known a frame tells the crosstalk as an empty one: linear least squares.

    Range and crosstalk together are what one window alone does not tell at all.
    """
    sensor = sensor_of(NOISE)
    sd = 1e-2
    prior = {"prior": "normal", "mean": 0.0, "sd": sd}
    scene = scene_of(PLATE, crosstalk=[prior, prior])
    bare = scene_of(PLATE)
    r = np.linspace(0.5, 1.0, 30)
    true = np.array([4e-3, -6e-3])
    rng = np.random.default_rng(4)
    readings = read(sensor, bare, r, rng) + true
    frames = known_at(frames_of(readings), {i: (float(r[i]), 1e-5) for i in range(30)})
    settings = TrackingSettings(observables=observables)
    result = track(sensor, scene, frames, settings)
    assert result.crosstalk is not None
    assert result.crosstalk_sd is not None
    terms = parameters_of(sensor, bare).terms(np.zeros((1, 0)))
    left = readings - mean_readings(sensor, terms, r)
    precision = 30 / NOISE**2 + sd**-2
    wanted = left.sum(axis=0) / NOISE**2 / precision
    used = [0, 1] if observables == "readings" else [1]
    assert result.crosstalk_sd[-1][used] == pytest.approx(precision**-0.5, rel=0.02)
    assert result.crosstalk[-1][used] == pytest.approx(wanted[used], abs=0.1 * precision**-0.5)
    assert (result.outlier < 0.5).all()


def deviations(kind: str, frame: int, seeds: int, *, cut: bool) -> tuple[Array, Array, Array]:
    """Of an object that comes nearer, predicted far off because its light may be crosstalk.

    Its range is known to 5 mm in one frame, whose readings may be cut off. Errors in their own
    deviations of the crosstalk in that frame and in the next, shape (2, seeds, 2), and of the range
    in the next, shape (seeds,); those deviations of that frame's crosstalk as shares of what its
    readings and range alone leave open, shape (seeds, 2).
    """
    noise = NOISE / 3.0
    sensor, bare = sensor_of(noise, kind, full_scale=[1.0, 1.0]), scene_of(PLATE)
    light = 300.0 * noise
    priors = [{"prior": "normal", "mean": 0.0, "sd": scale * light} for scale in (0.3, 0.6)]
    scene = scene_of(PLATE, crosstalk=priors)
    true = np.array([0.05, 0.3]) * light
    r, sd = np.asarray(1.5 - 0.01 * np.arange(frame + 2), dtype=np.float64), 0.005
    terms = parameters_of(sensor, bare).terms(np.zeros((1, 0)))
    ends = mean_readings(sensor, terms, r[frame] + np.array([-sd, sd]))
    alone = np.hypot(noise, 0.5 * (ends[1] - ends[0]))
    of_crosstalk, of_range = np.zeros((2, seeds, 2)), np.zeros(seeds)
    share = np.zeros((seeds, 2))
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        readings = read(sensor, bare, r, rng) + true
        if cut:
            readings[frame] = 2.0
        known = {frame: (float(r[frame] + sd * rng.standard_normal()), sd)}
        result = track(sensor, scene, known_at(frames_of(readings, 0.05), known))
        assert result.crosstalk is not None
        assert result.crosstalk_sd is not None
        of_crosstalk[:, seed] = ((result.crosstalk - true) / result.crosstalk_sd)[frame:]
        of_range[seed] = ((result.best_m - r) / result.best_sd_m)[frame + 1]
        share[seed] = result.crosstalk_sd[frame] / alone
    return of_crosstalk, of_range, share


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("frame", [1, 7, 15])
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_a_later_known_range_teaches_what_its_frame_tells(kind: str, frame: int, cut: bool) -> None:
    """Sums of squared deviations follow chi-square laws, at a millionth."""
    seeds = 20
    of_crosstalk, of_range, share = deviations(kind, frame, seeds, cut=cut)
    most = stats.chi2.isf(1e-6, seeds)
    assert ((of_crosstalk**2).sum(axis=1) < most).all()
    assert (of_range**2).sum() < most
    if not cut:
        # what was known before can only add to what the frame tells alone, to first order; in the
        # second frame range and crosstalk still lie on a curve, in parts that do not agree by that
        assert share.max() < (1.3 if frame == 1 else 1.1)


def test_a_known_range_that_contradicts_its_frame_is_an_outlier_and_then_a_misfit() -> None:
    """Readings of 0.8 m where 1.2 m is known: the frame is named, nothing is averaged."""
    sensor, scene = sensor_of(NOISE), scene_of(PLATE)
    r = np.full(60, 0.8)
    readings = read(sensor, scene, r, np.random.default_rng(6))
    once = known_at(frames_of(readings), {20: (1.2, 0.01)})
    result = track(sensor, scene, once)
    assert np.flatnonzero(result.outlier > 0.5).tolist() == [20]
    assert result.best_m[20] == pytest.approx(1.2, abs=0.03)
    assert not result.misfit.any()
    assert np.abs(result.range_m[30:] - 0.8).max() < 0.02
    always = known_at(frames_of(readings), dict.fromkeys(range(60), (1.2, 0.01)))
    result = track(sensor, scene, always)
    assert (result.outlier > 0.99).all()
    assert result.misfit[20:].all()
    # what agrees is neither
    true = known_at(frames_of(readings), dict.fromkeys(range(60), (0.8, 0.01)))
    result = track(sensor, scene, true)
    assert result.outlier.max() < 0.1
    assert not result.misfit.any()


def test_saturated_frames_and_outliers_have_their_known_range() -> None:
    sensor = sensor_of(NOISE, full_scale=[0.2, 0.2])
    scene = scene_of(PLATE)
    r = np.full(10, 0.8)
    readings = read(sensor, scene, r, np.random.default_rng(7))
    readings[0] = 1.0  # cut off, before anything was seen
    readings[5] = [-0.1, 0.15]
    known = dict.fromkeys((0, 5), (0.8, 0.001))
    result = track(sensor, scene, known_at(frames_of(readings, 1.0), known))
    assert result.status[0] == Status.SATURATED
    assert result.outlier[0] == 0.0
    assert result.outlier[5] > 0.99
    for i in (0, 5):
        assert result.best_m[i] == pytest.approx(0.8, abs=1e-3)
        assert result.best_sd_m[i] == pytest.approx(1e-3, rel=0.1)
        assert result.present[i] == pytest.approx(1.0)


@pytest.mark.parametrize("unknown", [{}, {"crosstalk": UNKNOWN_CROSSTALK}])
def test_a_stream_with_known_ranges_may_be_cut_anywhere(unknown: dict[str, Any]) -> None:
    """Batches with and without the columns give the same bits as all in one."""
    sensor, scene = sensor_of(NOISE), scene_of(FOLDED, **unknown)
    u, _ = wander(np.random.default_rng(8), 30, TrackingSettings(), (-0.2, 0.3))
    readings = read(sensor, scene_of(FOLDED), np.exp(u), np.random.default_rng(8))
    frames = known_at(frames_of(readings), {i: (float(np.exp(u[i])), 0.03) for i in (3, 4, 17)})
    model = tracker(sensor, scene)
    _, whole = step(model, model.first, frames)
    state, parts = model.first, []
    for start in range(0, 30, 5):
        part = frames.select(slice(start, start + 5))
        if np.isnan(part.known_range_m).all():  # type: ignore[arg-type]
            part = dataclasses.replace(part, known_range_m=None, known_range_sd_m=None)
        state, result = step(model, state, part)
        parts.append(result)
    assert_same(whole, joined(parts))


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_known_ranges_do_not_depend_on_the_unit_of_the_readings(scale: float) -> None:
    rng = np.random.default_rng(9)
    sensor, scene = sensor_of(NOISE), scene_of(PLATE)
    r = np.linspace(0.5, 0.8, 10)
    readings = read(sensor, scene, r, rng)
    known = {i: (float(r[i]) + 0.002, 0.003) for i in (0, 4, 5)}
    one = track(sensor, scene, known_at(frames_of(readings), known))
    other = track(
        sensor_of(NOISE * scale, gain=scale), scene, known_at(frames_of(readings * scale), known)
    )
    np.testing.assert_allclose(other.range_m, one.range_m, rtol=1e-9)
    np.testing.assert_allclose(other.sd_m, one.sd_m, rtol=1e-6)


def test_what_a_tracker_cannot_take_is_named() -> None:
    sensor, scene = sensor_of(NOISE), scene_of(PLATE)
    readings = read(sensor, scene, np.full(3, 0.8), np.random.default_rng(0))
    with pytest.raises(InvalidInputError) as caught:
        track(sensor, scene, known_at(frames_of(readings), {1: (5.0, 0.01)}))
    assert [p.pointer for p in caught.value.problems] == ["/frames/known_range_m"]
    moved = dataclasses.replace(
        frames_of(readings), displacement_m=np.zeros(3), displacement_sd_m=np.full(3, 0.1)
    )
    with pytest.raises(InvalidInputError) as caught:
        track(sensor, scene, moved)
    assert [p.pointer for p in caught.value.problems] == ["/frames/displacement_m"]
