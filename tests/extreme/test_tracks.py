"""The tracker at the ends, held to the truth, a dense grid and laws; more in `make stress`."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.extreme.tracks import TrackCase, grid_miss, holes_of, random_track, verdict_of
from tests.posterior.scenes import OBJECT
from tests.tracking.reference import GridFilter
from tests.tracking.scenes import PLATE, frames_of, read, scene_of, sensor_of
from tests.tracking.test_track import assert_same, joined

# beside a wall, with errors of the model: an object in the dark, whose ranges are many; a reading
# that turns back along the range while errors of the distance hide the other one
_WERE_WRONG = (1284, 1735)


def test_tracks_hold_the_truth_and_have_no_holes() -> None:
    """No range that is called the only one is six standard deviations off: docs/stability.md."""
    refused = 0
    for number in (*range(25), *_WERE_WRONG):
        verdict = verdict_of(random_track(number))
        assert not verdict.wrong, (number, verdict)
        assert not verdict.worst > 6, (number, verdict)
        refused += bool(verdict.refused)
    assert refused < 5


def test_faint_tracks_are_those_of_a_dense_grid() -> None:
    """The filter keeps a few Gaussians of what the grid keeps all of."""
    misses = [grid_miss(random_track(number, faint=True)) for number in range(12)]
    found = [miss for miss in misses if miss is not None]
    assert len(found) > 9
    assert max(found) < 0.25
    assert np.mean(found) < 0.05


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_an_error_of_the_table_is_part_of_the_error(kind: str) -> None:
    """Noise of 1e-13 of the light, which no table holds: ranges were off by 50 of their errors."""
    sensor, scene = sensor_of(7.72e-3 * 1e-12, kind), scene_of(PLATE, motion="static")
    ranges = np.full(30, 0.4321)
    frames = frames_of(read(sensor, scene, ranges, np.random.default_rng(0)))
    found = track(sensor, scene, frames)
    assert (np.abs(found.range_m - ranges) < 6 * found.sd_m).all()
    assert (found.sd_m < 1e-13 * ranges).all()
    assert found.outlier.max() < 1e-3
    assert not found.misfit.any()


def test_a_faint_object_is_as_wide_as_a_grid_has_it_although_the_model_errs() -> None:
    """Into the dark within a frame: all that is left is that the object is not near.

    Where anything of the scene was uncertain only the mode was taken, with a standard deviation of
    a sixth of what it is.
    """
    settings = TrackingSettings(rate_sd=1.5, rate_time_s=0.25, outlier=1e-9)
    sensor = sensor_of(7.72e-5)
    law = {"range_m": {"prior": "loguniform", "low": 0.1, "high": 14.0}}
    scene = scene_of(PLATE, **law, discrepancy={"flux": 0.003, "range_m": 0.0})
    grid = GridFilter(sensor, scene_of(PLATE, **law), settings, (0.1, 14.0), 1024, 41)
    readings = read(sensor, scene, np.array([1.0, 3.5]), np.random.default_rng(0))
    readings[1] = 0.3 * 7.72e-5, 1.6 * 7.72e-5
    found = track(sensor, scene, frames_of(readings, 1.0), settings)
    grid.see(readings[0])
    grid.move(1.0)
    grid.see(readings[1])
    mean, sd = grid.moments()
    assert sd > 0.3
    weight = np.nan_to_num(found.hypotheses_weight[1])
    weight /= weight.sum()
    u, own = np.log(found.hypotheses_m[1]), found.hypotheses_sd_m[1] / found.hypotheses_m[1]
    centre = np.nansum(weight * u)
    spread = np.sqrt(np.nansum(weight * (own**2 + (u - centre) ** 2)))
    assert centre == pytest.approx(mean, abs=0.3 * sd)
    assert spread == pytest.approx(sd, rel=0.2)


@pytest.mark.parametrize("turn", [0.01, 0.3])
def test_light_that_is_turned_far_is_not_taken_for_less_light(turn: float) -> None:
    """An error of the distance and none of the flux: half its square passed for knowledge.

    Ranges were up to 1e6 standard deviations off. The bar is six, of 24 draws of one error each.
    """
    wave = 4 * np.pi * 5e6 / 299792458.0
    law = {"prior": "loguniform", "low": 0.1, "high": 12.0}
    stated = {"object": OBJECT, "range_m": law}
    scene = parse_scene({**stated, "discrepancy": {"flux": 1e-9, "range_m": turn / wave}})
    sensor = sensor_of(7.72e-3 * 1e-9, "sine_wave")
    model = tracker(sensor, scene)
    for seed in range(24):
        at = SampledTrajectory(range_m=[1.0], time_s=[0.0])
        _, found = step(model, model.first, simulate(sensor, scene, at, seed).frames)
        assert np.abs(np.log(found.best_m[0])) < 6 * found.best_sd_m[0] / found.best_m[0]


def test_a_turn_of_more_than_a_radian_is_refused() -> None:
    scene = parse_scene({"object": OBJECT, "discrepancy": {"flux": 0.0, "range_m": 5.0}})
    with pytest.raises(RefusedError, match="more than a radian"):
        tracker(sensor_of(1e-6, "sine_wave"), scene)
    tracker(sensor_of(1e-6), scene)


def _scaled(document: Any, powers: dict[str, float]) -> Any:
    if not isinstance(document, dict):
        return document
    return {
        key: [v * powers[key] for v in value]
        if key in powers and isinstance(value, list)
        else value * powers[key]
        if key in powers
        else _scaled(value, powers)
        for key, value in document.items()
    }


def _other(case: TrackCase, light: float, length: float) -> TrackCase:
    """State a stream in other units of readings and of length."""
    # the discrepancy's range_m is a number, the scene's a prior
    scene = _scaled(
        case.scene,
        {
            "c0": length**2,
            "c1": length,
            "distance_m": length,
            "low": length,
            "high": length,
            "strength": light,
            "crosstalk": light,
        },
    )
    if scene["discrepancy"]:
        errors = scene["discrepancy"]
        scene["discrepancy"] = {**errors, "range_m": errors["range_m"] * length}
    sensor = {**case.sensor, "gain": case.sensor["gain"] * light * length**2}
    powers = {"read": light, "shot": light, "pulse_width_s": length, "frequency_hz": 1 / length}
    shown = dataclasses.replace(case.frames, readings=case.frames.readings * light)
    return dataclasses.replace(
        case,
        sensor=_scaled(sensor, powers),
        scene=scene,
        frames=shown,
        ranges=case.ranges * length,
    )


STREAMS = [4, 7, 9, 14]  # of twenty frames


@pytest.mark.parametrize("number", STREAMS)
@pytest.mark.parametrize("power", [-40, 40])
def test_nothing_depends_on_the_unit_of_readings(number: int, power: int) -> None:
    """Powers of two round nothing: the same bits."""
    case = random_track(number)
    assert_same(case.tracked(), _other(case, 2.0**power, 1.0).tracked())


@pytest.mark.parametrize("number", STREAMS[:3])
@pytest.mark.parametrize("power", [-20, 20])
def test_nothing_depends_on_the_unit_of_length(number: int, power: int) -> None:
    """Of log r a constant is another, which rounds; the table's knots lie elsewhere by that."""
    case = random_track(number)
    one, other = case.tracked(), _other(case, 1.0, 2.0**power).tracked()
    assert np.array_equal(one.status, other.status)
    sd = one.best_sd_m / one.best_m
    moved = np.abs(np.log(other.best_m / one.best_m) - power * np.log(2))
    assert (moved[np.isfinite(sd)] < 0.02 * sd[np.isfinite(sd)] + 1e-12).all()
    np.testing.assert_allclose(other.best_sd_m / other.best_m, sd, rtol=0.01)
    np.testing.assert_allclose(other.present, one.present, atol=1e-3)


@pytest.mark.parametrize("number", STREAMS)
def test_a_stream_at_the_ends_may_be_cut_anywhere(number: int) -> None:
    case = random_track(number)
    model = tracker(*case.parsed, case.settings)
    _, whole = step(model, model.first, case.frames)
    parts: list[Track] = []
    state = model.first
    for rows in np.split(np.arange(20), [1, 2, 9]):
        state, part = step(model, state, case.frames.select(rows))
        parts.append(part)
    assert_same(whole, joined(parts))


def test_a_stream_of_one_frame_over_and_over_has_no_holes() -> None:
    """At rest, stated to move: 4,000 identical frames, noise of 1e-2 to 1e12 of the light."""
    for kind in ("pulsed", "sine_wave"):
        for snr in (1e-2, 1e5, 1e12):
            sensor, scene = sensor_of(7.72e-3 / snr, kind), scene_of(PLATE)
            one = read(sensor, scene, np.array([0.7]), np.random.default_rng(1))
            count = 4000
            frames = Frames(np.repeat(one, count, axis=0), time_s=0.01 * np.arange(float(count)))
            found = track(sensor, scene, frames)
            assert not holes_of(found)
            # noise that is the same in every frame moves the range as far as that of one frame
            assert found.present[-1] > 0.9 or snr < 1


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-310, 1e308])
def test_readings_at_the_ends_of_numbers_have_no_holes(size: float) -> None:
    sensor = parse_sensor({**PULSE, "noise": {"read": [1e-6, 1e-6], "shot": 1e-9}})
    frames = frames_of(np.array([[size, size], [-size, size], [size, -size], [3e-3, 7e-3]]))
    found = track(sensor, scene_of(PLATE), frames)
    assert not holes_of(found)


PULSE = {"kind": "pulsed", "pulse_width_s": 1e-7}
