"""Frames that are stated empty, one of which is not, beside crosstalk that is learnt."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.sensor import Sensor
from tests.tracking.scenes import PLATE, STEP, read, scene_of, sensor_of

Array = NDArray[np.float64]
KIND = ["pulsed", "sine_wave"]
READ, CROSSTALK = 2e-4, np.array([0.01, 0.02])
WAY = np.geomspace(1.2, 0.35, 60)  # of the object that comes afterwards
WIDE = [{"prior": "normal", "mean": 0.0, "sd": 0.2}] * 2  # a thousand noises
ASIDE = np.array([0.3, 1.0])  # what a glitch adds, in so many noises
SEEDS = 3
COUNTED = 400  # tracks of 25 frames, of which one in a million is an outlier


def sensor_for(kind: str) -> Sensor:
    return sensor_of(READ, kind)


def recorded(
    kind: str, off: dict[int, float], empty: int, seed: int = 0, *, drifted: int | None = None
) -> tuple[Array, Array]:
    """Readings and ranges: so many frames are stated empty, some of which are so many noises off.

    Crosstalk has another value from frame ``drifted`` on: what was off stays.
    """
    ranges = np.concatenate([np.full(empty, np.inf), WAY])
    rng = np.random.default_rng(seed)
    y = read(sensor_for(kind), scene_of(PLATE), ranges, rng) + CROSSTALK
    for frame, noises in off.items():
        y[frame] += noises * READ * ASIDE
    if drifted is not None:
        y[drifted:] += 300 * READ * ASIDE
    return y, ranges


def frames_for(readings: Array, empty: int) -> Frames:
    count = len(readings)
    stated = np.arange(count) >= empty
    return Frames(readings, time_s=STEP * np.arange(count, dtype=float), object_present=stated)


def followed(
    kind: str,
    readings: Array,
    empty: int,
    priors: Any = None,
    settings: TrackingSettings | None = None,
) -> Track:
    scene = scene_of(PLATE, crosstalk=WIDE if priors is None else priors)
    return track(sensor_for(kind), scene, frames_for(readings, empty), settings)


def crosstalk_off(found: Track, frame: int, truth: Array = CROSSTALK) -> float:
    """How far learnt crosstalk is off, in its standard deviations."""
    assert found.crosstalk is not None
    assert found.crosstalk_sd is not None
    return float((np.abs(found.crosstalk[frame] - truth) / found.crosstalk_sd[frame]).max())


def silently_off(found: Track, ranges: Array) -> float:
    """How far a range is off at most, in its standard deviations, without misfit; 0 of none."""
    off = np.abs(found.range_m - ranges) / found.sd_m
    told = np.isfinite(off) & ~found.misfit
    return float(off[told].max(initial=0.0))


OFF: dict[str, tuple[int, dict[int, float]]] = {
    "one in the middle": (25, {12: 1.0}),
    "the last": (25, {24: 1.0}),
    "the first": (25, {0: 1.0}),
    "one of five": (5, {2: 1.0}),
    "the first of three": (3, {0: 1.0}),
    "the last of three": (3, {2: 1.0}),
    "several": (25, {2: 1.0, 3: -0.4, 9: 2.0, 14: -1.0, 15: 0.7, 23: 1.0}),
    "two unlike ones first": (25, {0: 1.0, 1: -0.5}),
    "a hand": (25, {11: 1.0, 12: 1.0, 13: 1.0}),
    "a hand first": (25, {0: 1.0, 1: 1.0, 2: 1.0}),
    "a hand twice": (25, {3: 1.0, 4: 1.0, 5: 1.0, 15: -1.0, 16: -1.0, 17: -1.0}),
}


@pytest.mark.parametrize("kind", KIND)
@pytest.mark.parametrize("noises", [30.0, 300.0, 5000.0])
@pytest.mark.parametrize("case", OFF)
def test_what_most_frames_tell_is_held(case: str, noises: float, kind: str) -> None:
    """Believed, one of 300 noises left crosstalk 60 of its standard deviations off."""
    empty, off = OFF[case]
    for seed in range(SEEDS):
        scaled = {frame: size * noises for frame, size in off.items()}
        readings, ranges = recorded(kind, scaled, empty, seed)
        found = followed(kind, readings, empty)
        assert crosstalk_off(found, empty - 1) < 4.5
        assert silently_off(found, ranges) < 5.0
        told = np.isfinite(found.range_m[empty:])
        assert told.mean() > 0.9
        said = found.outlier[:empty]
        if 0 not in off:
            assert said[list(off)].min() > 0.99
            assert np.delete(said, list(off)).max() < 0.5


@pytest.mark.parametrize("kind", KIND)
@pytest.mark.parametrize(
    ("empty", "off"),
    [(2, [0]), (2, [1]), (4, [0, 2]), (4, [2, 3]), (25, [22, 23, 24])],
)
def test_where_nobody_knows_crosstalk_is_as_wide_as_both(
    empty: int, off: list[int], kind: str
) -> None:
    """As many say the one as the other, or the last ones another than all before."""
    for seed in range(SEEDS):
        readings, ranges = recorded(kind, dict.fromkeys(off, 300.0), empty, seed)
        found = followed(kind, readings, empty)
        assert found.crosstalk is not None
        assert found.crosstalk_sd is not None
        half = 150 * READ * ASIDE
        assert np.abs(found.crosstalk[empty - 1] - CROSSTALK - half).max() < 3 * READ
        assert np.abs(found.crosstalk_sd[empty - 1] - half).max() < 3 * READ
        assert silently_off(found, ranges) < 5.0
        other, ranges = recorded(kind, {}, empty, seed, drifted=empty - len(off))
        if off[0] == empty - len(off):
            # the last ones are right: what they tell is there from then on
            assert silently_off(followed(kind, other, empty), ranges) < 5.0


@pytest.mark.parametrize("kind", KIND)
@pytest.mark.parametrize("drift", [None, (1e-4, 1e-4)])
def test_crosstalk_that_has_changed_is_learnt_once_most_say_so(
    drift: tuple[float, float] | None, kind: str
) -> None:
    """It is a misfit until then: outliers come one after another."""
    settings = TrackingSettings(crosstalk_drift=drift)
    readings, ranges = recorded(kind, {}, 25, drifted=8)
    found = followed(kind, readings, 25, settings=settings)
    after = CROSSTALK + 300 * READ * ASIDE
    assert crosstalk_off(found, 7) < 4.0
    assert crosstalk_off(found, 12, after) < 2.0
    assert crosstalk_off(found, 24, after) < 4.0
    assert found.outlier[[8, 9, 10]].min() > 0.99
    assert found.outlier[17:25].max() < 0.5
    assert silently_off(found, ranges) < 5.0


@pytest.mark.parametrize("kind", KIND)
def test_a_prior_counts_as_a_frame_that_it_can_judge(kind: str) -> None:
    """Crosstalk known to half a noise beforehand is right beside one frame that is not."""
    known = [{"prior": "normal", "mean": m, "sd": 0.5 * READ} for m in CROSSTALK]
    readings, ranges = recorded(kind, {1: 300.0}, 2)
    found = followed(kind, readings, 2, known)
    assert found.outlier[1] > 0.99
    assert crosstalk_off(found, 1) < 4.0
    assert silently_off(found, ranges) < 5.0


@pytest.mark.parametrize("kind", KIND)
def test_frames_without_a_fault_are_learnt_as_ever(kind: str) -> None:
    """None of 10,000 is passed over; the crosstalk is their mean, as wide as noise leaves it."""
    model = tracker(sensor_for(kind), scene_of(PLATE, crosstalk=WIDE))
    rng = np.random.default_rng(5)
    for _ in range(COUNTED):
        readings = CROSSTALK + READ * rng.standard_normal((25, 2))
        _, found = step(model, model.first, frames_for(readings, 25))
        assert found.crosstalk is not None
        assert found.crosstalk_sd is not None
        assert found.outlier.max() < 0.5
        assert np.allclose(found.crosstalk[-1], readings.mean(axis=0), atol=1e-4 * READ)
        assert np.allclose(found.crosstalk_sd[-1], READ / 5, rtol=1e-4)


@pytest.mark.parametrize("kind", KIND)
def test_known_crosstalk_takes_no_part(kind: str) -> None:
    readings, _ = recorded(kind, {12: 300.0}, 25)
    clean, _ = recorded(kind, {}, 25)
    found = followed(kind, readings, 25, CROSSTALK.tolist())
    other = followed(kind, clean, 25, CROSSTALK.tolist())
    assert found.outlier[:25].max() == 0.0
    assert np.array_equal(found.range_m, other.range_m, equal_nan=True)
    assert np.array_equal(found.sd_m, other.sd_m, equal_nan=True)


@pytest.mark.parametrize("kind", KIND)
def test_a_stream_that_is_cut_says_the_same(kind: str) -> None:
    """Also between frames that contradict one another, and before what ends the doubt."""
    readings, _ = recorded(kind, {0: 300.0, 5: 300.0, 6: 300.0}, 7)
    frames = frames_for(readings, 7)
    model = tracker(sensor_for(kind), scene_of(PLATE, crosstalk=WIDE))
    _, whole = step(model, model.first, frames)
    state, parts = model.first, []
    for i in range(len(frames)):
        state, part = step(model, state, frames.select(np.array([i])))
        parts.append(part)
    for name in ("range_m", "sd_m", "crosstalk", "crosstalk_sd", "outlier"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True)


@pytest.mark.parametrize("kind", KIND)
def test_light_of_a_wall_and_the_gain_are_no_contradiction(kind: str) -> None:
    """A rival is of the crosstalk, not of the scene's own light at some gain."""
    wall = {"background": {"strength": 0.3, "distance_m": 4.0, "shadow": {"c0": 0.05, "c1": 0.02}}}
    scene, sensor = scene_of(PLATE, **wall), sensor_for(kind)
    gains = np.linspace(0.7, 1.3, 12)
    rng = np.random.default_rng(3)
    still = read(sensor, scene, np.full(12, np.inf), rng)
    light = still.mean(axis=0)
    readings = still + np.outer(gains - 1.0, light) + CROSSTALK
    readings[[0, 1]] += 300 * READ * ASIDE
    frames = Frames(
        readings,
        time_s=STEP * np.arange(12, dtype=float),
        object_present=np.zeros(12, dtype=bool),
        gain=gains,
    )
    found = track(sensor, scene_of(PLATE, **wall, crosstalk=WIDE), frames)
    assert crosstalk_off(found, 11) < 4.0
    assert found.crosstalk_sd is not None
    assert found.crosstalk_sd[11].max() < 0.5 * READ
