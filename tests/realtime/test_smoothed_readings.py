"""Readings that a driver smooths over frames are doubted; those with the stated noise are not."""

import math

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from benchmarks.smoothed_readings import smoothed
from inference import smoothed_readings as module
from inference.estimate import estimate
from inference.smoothed_readings import smoothed_readings
from service.plausibility import doubts
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

Array = NDArray[np.float64]

READ = (2e-3, 5e-3)


def _sensor(scale: float = 1.0, full_scale: float | None = None) -> Sensor:
    document = {
        "kind": "sine_wave",
        "frequency_hz": 2e7,
        "noise": {"read": [scale * READ[0], scale * READ[1]]},
    }
    ends = {} if full_scale is None else {"full_scale": [full_scale, full_scale]}
    return parse_sensor(document | ends)


def _noise(seed: int, n: int, over: int = 1) -> Array:
    """Noise of a driver that hands on a moving average as of so many frames; 1 is none."""
    rng = np.random.default_rng(seed)
    return smoothed(rng.standard_normal((n + 40, 2)) * READ, 2.0 / (over + 1.0))[40:]


def _path(n: int) -> Array:
    """Readings of an object on its way, many noises apart."""
    t = np.linspace(0.0, 1.0, n)[:, None]
    return np.asarray(0.4 + 0.2 * np.cos(3.0 * t + [0.0, 1.0]))


@pytest.mark.parametrize("over", [4, 8])
def test_a_drivers_average_is_doubted_behind_motion(over: int) -> None:
    """Of 32 frames: seen in 99 of 100 such noises at least, so that 8 of 10 fail once in 1e7."""
    said = [
        smoothed_readings(_sensor(), Frames(_path(32) + _noise(k, 32, over))) for k in range(10)
    ]
    assert sum(one is not None for one in said) >= 8
    assert all(one.startswith("i and q differ from frame to frame") for one in said if one)


def test_readings_with_the_stated_noise_are_doubted_as_seldom_as_stated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With a false alarm of a hundredth; more alarms than that by chance once in 1e6."""
    monkeypatch.setattr(module, "_FALSE_ALARM", 1e-2 / 3)
    monkeypatch.setattr(module, "_WORTH", 1.0)
    sets = 400
    for n in (12, 40):
        said = [smoothed_readings(_sensor(), Frames(_noise(k, n))) for k in range(sets)]
        assert sum(one is not None for one in said) <= scipy.stats.binom.isf(1e-6, sets, 1e-2)


@pytest.mark.parametrize("square", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("count", [8, 30])
def test_the_bound_is_above_the_law_and_not_far(square: float, count: int) -> None:
    """Of equal weights the law is chi-square. Chernoff's bound is a Gaussian's width above it."""
    bound = module._log_often(square * count * 3.0, np.full(count, 3.0))
    law = float(scipy.stats.chi2(count).logcdf(square * count))
    assert law < bound < law + math.log(10.0 * math.sqrt(count))


def test_the_weights_are_those_of_differences() -> None:
    """The sum of squares of fourth differences of unit noise: its mean is 70 for each."""
    weights = module._eigenvalues(20)
    assert weights.shape == (16,)
    assert weights.sum() == pytest.approx(70.0 * 16, rel=1e-12)
    pairs = np.square(np.diff(np.eye(20), 4, axis=0) @ np.diff(np.eye(20), 4, axis=0).T).sum()
    assert np.square(weights).sum() == pytest.approx(pairs, rel=1e-12)


def test_one_column_is_named_with_its_size() -> None:
    """A tenth of the stated noise in q alone."""
    readings = _noise(3, 64) * [1.0, 0.1]
    said = smoothed_readings(_sensor(), Frames(readings))
    assert said is not None
    assert said.startswith("q differs from frame to frame by less than read noise alone: 0.")
    share = float(said.split(": ")[1].split()[0])
    assert 0.07 < share < 0.13


def test_a_noise_stated_half_again_too_large_is_only_cautious() -> None:
    assert smoothed_readings(_sensor(), Frames(_noise(4, 400) / 1.5)) is None
    assert smoothed_readings(_sensor(), Frames(_noise(4, 400) / 3.0)) is not None


def test_rounding_to_steps_of_the_noise_is_no_smoothness() -> None:
    """Of an object at rest: few frames read the other of two steps, many noises of it wide."""
    rng = np.random.default_rng(5)
    step = np.where(rng.random((60, 2)) < 0.1, READ, 0.0)
    assert np.square(np.diff(0.5 * step, 4, axis=0) / READ).mean() < 0.25 * 70.0
    assert smoothed_readings(_sensor(), Frames(0.7 + 0.5 * step)) is None
    # as much from frame to frame, and no steps
    fine = 0.05 * _noise(6, 60)
    assert smoothed_readings(_sensor(), Frames(0.7 + 0.5 * step + fine)) is not None
    assert smoothed_readings(_sensor(), Frames(np.full((60, 2), 0.7))) is None


def test_frames_at_full_scale_do_not_count() -> None:
    readings = _path(48) + _noise(7, 48)
    readings[16:] = 1.0
    assert smoothed_readings(_sensor(full_scale=1.0), Frames(readings)) is None
    smooth = _path(48) + _noise(7, 48, 8)
    smooth[::12] = 1.0
    assert smoothed_readings(_sensor(), Frames(smooth)) is None
    assert smoothed_readings(_sensor(full_scale=1.0), Frames(smooth)) is not None


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_units_of_the_readings_change_nothing(scale: float) -> None:
    readings = _noise(8, 90, 4)
    assert smoothed_readings(_sensor(scale), Frames(scale * readings)) == smoothed_readings(
        _sensor(), Frames(readings)
    )


def test_estimates_and_the_command_line_say_it() -> None:
    readings = _path(40) + _noise(9, 40, 8)
    said = smoothed_readings(_sensor(), Frames(readings))
    found = estimate(_sensor(), parse_scene({}), Frames(readings), ["conventional"])
    assert said in found.assumptions
    assert said in doubts(_sensor(), Frames(readings))
    assert smoothed_readings(_sensor(), Frames(readings[:11])) is None
