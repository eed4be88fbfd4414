"""Changes that the law of a scene would hide, and scenes that share what was known before."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.self_calibration.change import (
    Residuals,
    _nearest,
    has_changed,
    surprises_of,
    without_unknowns,
)
from inference.self_calibration.mixing import mixed, with_modes
from inference.tracking.readings_table import MEAN, SPREAD
from inference.tracking.settings import TrackingSettings
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import mean_readings, simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
N, BEHIND = 300, 100
Array = NDArray[np.float64]


def sensor_of(unit: float = 1.0, **noise: float) -> dict[str, object]:
    return {
        "kind": "pulsed",
        "pulse_width_s": 1e-7,
        "gain": unit,
        "noise": {"read": [8e-5 * unit, 8e-5 * unit], **noise},
    }


def scene_of(unit: float = 1.0) -> Scene:
    """Crosstalk that is known to a third or so."""
    return parse_scene(
        {
            "object": OBJECT,
            "crosstalk": [
                {"prior": "normal", "mean": 0.001 * unit, "sd": 4e-4 * unit},
                {"prior": "normal", "mean": 0.005 * unit, "sd": 2e-3 * unit},
            ],
            "range_m": {"prior": "loguniform", "low": 0.1, "high": 5.0},
            "joint": {
                "unknowns": ["crosstalk.w1", "crosstalk.w2"],
                "modes": [{"mean": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}],
            },
        }
    )


def noticed(
    seed: int, shift: tuple[float, float], unit: float = 1.0, walk: float = 0.0, **noise: float
) -> bool:
    """Tell whether a shift some frames before the last one is noticed."""
    rng = np.random.default_rng(seed)
    sensor, scene = parse_sensor(sensor_of(unit, **noise)), scene_of(unit)
    t = np.arange(N) / 30
    path = SampledTrajectory(
        range_m=np.exp(np.log(0.67) + 0.8 * np.sin(2.0 * t + 6.0 * rng.random())).tolist(),
        time_s=t.tolist(),
    )
    readings = simulate(sensor, parse_scene({"object": OBJECT}), path, seed).frames.readings
    size = np.array([0.001, 0.005]) * unit
    steps = walk / np.sqrt(30.0) * rng.standard_normal((N, 2)) * size
    crosstalk = size + rng.standard_normal(2) * 0.4 * size + np.cumsum(steps, axis=0)
    crosstalk[-BEHIND:] += np.array(shift) * unit
    model = tracker(sensor, scene, TrackingSettings(rate_sd=0.5))
    every = np.ones(N, dtype=bool)
    frames = Frames(readings + crosstalk, t)
    return has_changed(model, frames, every, walk * np.sqrt(5.0) * size, 0.9 * size)


def test_surprise_against_dense_covariances() -> None:
    rng = np.random.default_rng(1)
    n, p = 40, 5
    at = Residuals(rng.standard_normal(n), rng.standard_normal((n, p)), rng.standard_normal((n, 2)))
    behind = [np.arange(n) >= n - 20, np.arange(n) >= n - 9]
    left = without_unknowns(at, behind)
    for split, some in enumerate(behind):
        sd = np.array([3.0, 0.7])
        shifted = some[:, None] * at.across * sd
        covariance = np.eye(n) + at.changes @ at.changes.T + shifted @ shifted.T
        wanted = at.values @ np.linalg.solve(covariance, at.values)
        assert surprises_of(left, sd)[split] == pytest.approx(wanted, rel=1e-10)


def test_a_wall_within_the_law_is_noticed() -> None:
    """A shift by one standard deviation of what is known: no law of the scene is surprised."""
    seen = [noticed(seed, (4e-4, 2e-3)) for seed in range(6)]
    assert all(seen)


def test_what_has_not_changed_is_not_noticed() -> None:
    """One in a million each, by the bound: false-alarm rate 3e-5 of the test."""
    assert not any(noticed(seed, (0.0, 0.0)) for seed in range(100, 115))
    assert not any(noticed(seed, (0.0, 0.0), walk=0.01) for seed in range(200, 210))
    assert not any(noticed(seed, (0.0, 0.0), shot=1e-6, relative=0.01) for seed in range(300, 305))


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_change_nothing(unit: float) -> None:
    assert noticed(3, (4e-4, 2e-3), unit)
    assert not noticed(3, (0.0, 0.0), unit)


def test_one_number_a_frame_shows_no_change() -> None:
    model = tracker(
        parse_sensor(sensor_of()), scene_of(), TrackingSettings(rate_sd=0.5, observables="w2")
    )
    readings = np.column_stack([np.zeros(N), np.where(np.arange(N) < 200, 0.02, 0.05)])
    frames, every = Frames(readings, np.arange(N) / 30), np.ones(N, dtype=bool)
    assert not has_changed(model, frames, every, np.zeros(2), np.array([1e-3, 5e-3]))


def test_few_frames_or_dark_ones_show_no_change() -> None:
    model = tracker(parse_sensor(sensor_of()), scene_of(), TrackingSettings(rate_sd=0.5))
    widest, every = np.array([1e-3, 5e-3]), np.ones(N, dtype=bool)
    dark = Frames(np.tile([0.001, 0.005], (N, 1)), np.arange(N) / 30)
    assert not has_changed(model, dark, every, np.zeros(2), widest)
    few = dark.select(slice(0, 3))
    assert not has_changed(model, few, every[:3], np.zeros(2), widest)


def test_a_scene_that_shares_the_object_of_another() -> None:
    """Mean and covariance against draws of the two halves; 5 standard errors of 200,000."""
    stated = {
        "object": {
            "c0": 0.0769,
            "c1": -0.123,
            "c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
        },
        "crosstalk": [0.001, {"prior": "normal", "mean": 0.0, "sd": 0.01}],
    }
    names = ["crosstalk.w2", "object.c2"]
    found = parse_scene(
        stated
        | {"joint": {"unknowns": names,
                     "modes": [{"mean": [0.5, 0.2], "covariance": [[0.04, 0.03], [0.03, 0.09]]}]}}
    )  # fmt: skip
    before = parse_scene(
        stated
        | {
            "joint": {
                "unknowns": ["object.c2"],
                "modes": [{"mean": [-0.3], "covariance": [[0.01]]}],
            }
        }
    )
    law = mixed(found, before).joint
    assert law is not None
    assert law.unknowns == tuple(names)
    assert [mode.weight for mode in law.modes] == [0.5, 0.5]
    assert law.modes[0].mean == (0.5, 0.2)
    rng = np.random.default_rng(2)
    c2 = -0.3 + 0.1 * rng.standard_normal(200_000)
    # of a normal of two, given the other
    w2 = (
        0.5
        + 0.03 / 0.09 * (c2 - 0.2)
        + np.sqrt(0.04 - 0.03**2 / 0.09) * rng.standard_normal(c2.size)
    )
    draws = np.column_stack([w2, c2])
    np.testing.assert_allclose(law.modes[1].mean, draws.mean(axis=0), atol=5 * 0.2 / np.sqrt(2e5))
    np.testing.assert_allclose(
        law.modes[1].covariance, np.cov(draws.T), atol=5 * 0.06 / np.sqrt(2e5)
    )
    # nothing of an object: nothing to share
    assert mixed(scene_of(), scene_of()) == scene_of()
    assert (
        with_modes(scene_of(), [{"weight": 3.0, "mean": [0.0, 0.0], "covariance": np.eye(2)}])
        == scene_of()
    )


def test_laws_that_nearly_agree_are_shared_or_left_as_they_are() -> None:
    """Two unknowns of the object known by their ratio to 1e-6, beside a law 1e4 times as wide."""
    stated = {
        "object": {
            "c0": 0.0769,
            "c1": {"prior": "normal", "mean": -0.1, "sd": 0.1},
            "c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
        },
        "crosstalk": [0.001, {"prior": "normal", "mean": 0.0, "sd": 0.01}],
    }
    own = ["object.c1", "object.c2"]

    def scene(names: list[str], mean: list[float], factor: Array) -> Scene:
        mode = {"mean": mean, "covariance": (factor @ factor.T).tolist()}
        return parse_scene(stated | {"joint": {"unknowns": names, "modes": [mode]}})

    narrow, w2 = 1e-4, [0.02, 5e-8, 3e-4]
    factor = np.array([w2, [narrow, 0.0, 0.0], [narrow, narrow * 1e-6, 0.0]])
    found = scene(["crosstalk.w2", *own], [0.5, 0.0, 0.0], factor)
    wide = np.array([[1.0, 0.0], [0.9, 0.5]])
    # it follows 200 of one and 500 of the difference, less the same of the other
    law = mixed(found, scene(own, [0.1, 0.1], wide * 1e-3)).joint
    assert law is not None
    follow = np.array(w2[:2]) @ np.linalg.inv(factor[1:, :2])
    lower = np.vstack([follow @ wide * 1e-3, wide * 1e-3])
    wanted = lower @ lower.T + np.diag([w2[2] ** 2, 0.0, 0.0])
    np.testing.assert_allclose(law.modes[1].mean[1:], [0.1, 0.1], rtol=1e-12)
    # the factors are known to the rounding of a covariance of condition 4e12
    np.testing.assert_allclose(law.modes[1].covariance, wanted, rtol=1e-3)
    # farther than 100 standard deviations of the crosstalk's prior: no half that says so
    assert mixed(found, scene(own, [0.1, 0.1], wide)) == found


def test_ranges_start_where_the_object_is_and_not_where_anything_is_possible() -> None:
    # what a calibration leaves open of the shape: near by, all of the light
    noise = {"read": [2e-4, 2e-4]}
    sensor = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": noise})
    scene = parse_scene({"object": {"c0": 0.036, "c1": -0.038, "c2": 0.118}})
    table = tracker(sensor, scene).model.table
    knots = table.knots.copy()
    near = np.flatnonzero(table.start + table.step * np.arange(len(knots)) < np.log(0.05))
    knots[near, SPREAD], knots[near, SPREAD + 2] = knots[near, MEAN], knots[near, MEAN]
    ranges = np.geomspace(0.35, 2.0, 50)
    readings = mean_readings(sensor, parameters_of(sensor, scene).terms(np.zeros((1, 0))), ranges)
    u = table.start + _nearest(knots, readings / 2e-4) * table.step
    # one of the 128 places from which ranges are fitted
    assert np.abs(u - np.log(ranges)).max() < (table.end - table.start) / 128
