"""Readings that are smoothed over frames are a misfit, or said to scatter less than noise lets."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.smoothed_readings import smoothed
from inference.estimate import estimate
from inference.fits.answer.model_checks import REASONS, SUCCESSION
from inference.fits.answer.smoothed import SCATTER, SMOOTHED
from inference.fits.answer.succession import goes_on
from simulator.frames import Frames
from simulator.object_arrays import object_fluxes
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

RANGES, NOISE, OVER = np.linspace(0.3, 0.6, 50), 2e-3, 5


def left_by_a_fit(noise: Array) -> tuple[Array, Array]:
    """Smooth columns are fitted to noise; two more rows have nothing to do with it."""
    rows = noise.shape[-1]
    columns = np.vander(np.linspace(-1.0, 1.0, rows), 5)
    basis = np.linalg.qr(columns)[0]
    return noise - (noise @ basis) @ basis.T, basis


@pytest.mark.parametrize("size", [1.0, 0.01])
def test_independent_noise_of_any_size_goes_on_as_often_as_is_said(size: float) -> None:
    """Of 400 draws 5 % within 1.1 %, one standard error: three of them."""
    rng = np.random.default_rng(1)
    left, basis = left_by_a_fit(size * rng.standard_normal((400, 30)))
    frames = np.arange(30)
    often = np.array([goes_on(each, basis, frames) for each in left])
    assert 0.015 < np.mean(often < 0.05) < 0.085
    assert 0.45 < np.mean(often) < 0.55


def test_rows_of_two_readings_are_paired_with_the_same_reading() -> None:
    """Empty frames: one reading goes on, and never with the other one."""
    rng = np.random.default_rng(2)
    going, other = np.repeat(rng.standard_normal(10), 4), rng.standard_normal(40)
    left = np.stack([going, other], axis=1).ravel()
    none = np.zeros((80, 0))
    frames = np.repeat(np.arange(40), 2)
    assert goes_on(left, none, frames) < 1e-3
    assert goes_on(left, none, 2 * frames) == 1.0  # no two are successive
    assert goes_on(left[:2], none[:2], frames[:2]) == 1.0


def asked(share: float, stated: float) -> Any:
    phase = 4 * np.pi * 2e7 / 299792458.0 * RANGES
    flux = object_fluxes(RANGES, 0.006, 0.06, 0.04)
    readings = flux[:, None] * np.column_stack([np.cos(phase), np.sin(phase)])
    readings = np.vstack([np.repeat(readings[:1], 40, axis=0), readings])
    noisy = readings + NOISE * np.random.default_rng(3).standard_normal(readings.shape)
    noise = {"read": [stated, stated]}
    sensor = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": noise})
    return estimate(sensor, parse_scene({}), Frames(smoothed(noisy, share)[40:]), ["joint_fit"])


def test_readings_behind_a_low_pass_are_no_sure_range() -> None:
    """They are late by two frames' way: 5 sd and more, without a word, before."""
    share = 2.0 / (OVER + 1.0)
    found = asked(share, NOISE * (share / (2.0 - share)) ** 0.5)
    fit = found.results[0].fit
    assert fit["misfit"]
    assert REASONS[SUCCESSION] in fit["reasons"]
    assert fit["checks"]["chi_square"] > 0.01


def test_noise_that_is_too_large_is_said_and_withholds_nothing() -> None:
    found = asked(1.0, 3.0 * NOISE)
    (result,) = found.results
    assert SMOOTHED in found.assumptions
    assert result.fit["checks"][SCATTER] < 1e-4
    assert not result.fit["misfit"]
    assert np.isfinite(result.sd_m).all()
