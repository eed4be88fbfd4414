"""Simulation: the model's own numbers, seeds, units, and the law of the noise."""

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy

from simulator.frames import check_frames
from simulator.object_model import distortion, log_slope, quadratic
from simulator.readings import (
    background_readings,
    background_slopes,
    covariance,
    object_readings,
    object_slopes,
)
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, SineWaveSensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory, SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
WALL = {"strength": 0.02, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
PATH = SampledTrajectory(range_m=[0.05, 0.5, 2.5])
TINY = {"read": [1e-30, 1e-30]}


@pytest.mark.parametrize("c1", [-1.9999999, -1.0, 0.0, 50.0])
@pytest.mark.parametrize("r", [1e-6, 0.999999, 1.0, 1.00001, 300.0])
def test_the_quadratic_keeps_its_digits_near_the_poles(r: float, c1: float) -> None:
    with mpmath.workdps(60):
        exact = mpmath.mpf(r) ** 2 + mpmath.mpf(c1) * r + 1
    assert quadratic(r, 1.0, c1) == pytest.approx(float(exact), rel=8 * np.finfo(float).eps)


def test_slopes_are_derivatives() -> None:
    def flux(r: Any) -> Any:
        return 1 / (r**2 * (r**2 - mpmath.mpf("0.1") * r + mpmath.mpf("0.2")))

    with mpmath.workdps(40):
        r = mpmath.mpf("0.7")
        slope = mpmath.diff(flux, r) * r / flux(r)
        late = mpmath.diff(lambda x: x * flux(x), r) / mpmath.diff(flux, r) / r
    assert log_slope(0.7, 0.2, -0.1) == pytest.approx(float(slope), rel=1e-13)
    assert distortion(0.7, 0.2, -0.1) == pytest.approx(float(late), rel=1e-13)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_readings_are_those_of_the_model(kind: str) -> None:
    given = {"kind": kind, "gain": 2.0, "noise": TINY}
    if kind == "pulsed":
        sensor = parse_sensor({**given, "pulse_width_s": 1e-7})
    else:
        sensor = parse_sensor({**given, "frequency_hz": 5e6, "phase_offset_rad": 0.3})
    scene = parse_scene({"object": OBJECT, "background": WALL, "crosstalk": [0.1, 0.2]})
    readings = simulate(sensor, scene, PATH, 1).frames.readings
    for r, got in zip(PATH.range_m, readings, strict=True):
        flux = 2.0 * 0.0769 * 0.0957 / (r**2 * (r**2 - 0.123 * r + 0.0769))
        wall = 0.02 * (1 - 0.056 / (r**2 + 0.013 * r + 0.056))
        if isinstance(sensor, PulsedSensor):
            first = flux * r / sensor.r0 + wall * 3.0 / sensor.r0 + 0.1
            second = flux + wall + 0.2
        else:
            assert isinstance(sensor, SineWaveSensor)
            k = sensor.wave_number
            first = flux * math.cos(k * r + 0.3) + wall * math.cos(3 * k + 0.3) + 0.1
            second = flux * math.sin(k * r + 0.3) + wall * math.sin(3 * k + 0.3) + 0.2
        np.testing.assert_allclose(got, [first, second], rtol=1e-13)


@pytest.mark.parametrize("wave", [None, (0.2, 0.4)])
def test_slopes_of_readings_against_differences(wave: tuple[float, float] | None) -> None:
    wall = (0.02, 3.0, 0.056, 0.013)
    r, h = 0.7, 1e-6
    cases: list[tuple[Callable[[float], tuple[float, float]], tuple[float, float]]] = [
        (
            lambda x: object_readings(x, 15.0, wave, 1.0, 0.08, -0.1),
            object_slopes(r, 15.0, wave, 1.0, 0.08, -0.1),
        ),
        (
            lambda x: background_readings(x, 15.0, wave, wall),
            background_slopes(r, 15.0, wave, wall),
        ),
    ]
    for value, slope in cases:
        up, down = value(r * math.exp(h)), value(r * math.exp(-h))
        for j in range(2):
            # the error of a central difference: h^2 and rounding over h
            assert slope[j] == pytest.approx((up[j] - down[j]) / (2 * h), rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("spacing", ["linear", "log"])
def test_a_radial_way_has_both_of_its_ends(spacing: Any) -> None:
    way = RadialTrajectory(from_m=0.1, to_m=1.6, frames=5, spacing=spacing, duration_s=2.0)
    even = [0.1, 0.2, 0.4, 0.8, 1.6] if spacing == "log" else [0.1, 0.475, 0.85, 1.225, 1.6]
    np.testing.assert_allclose(way.ranges(), even, rtol=1e-14)
    np.testing.assert_allclose(way.times(), [0.0, 0.5, 1.0, 1.5, 2.0], rtol=1e-15)
    unhurried = RadialTrajectory(from_m=0.1, to_m=1.6, frames=5)
    np.testing.assert_allclose(unhurried.times(), [0.0, 0.01, 0.02, 0.03, 0.04], rtol=1e-14)


def test_same_seed_same_frames_and_another_seed_others() -> None:
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-3, 1e-3]}}
    )
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=7)
    first, again, other = (simulate(sensor, parse_scene({}), path, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.frames.readings, again.frames.readings)
    assert first.parameters == again.parameters
    assert not np.array_equal(first.frames.readings, other.frames.readings)


def test_errors_are_the_same_whatever_signs_eigenvectors_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Planted fault: the same seed drew another error of the flux on another processor."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-9, 1e-9]}}
    )
    scene = parse_scene(
        {
            "object": {"c0": 0.08, "c1": -0.1, "c2": 0.1},
            "discrepancy": {"flux": 0.1, "range_m": 1e-3},
        }
    )
    path = RadialTrajectory(from_m=0.1, to_m=1.0, frames=12)
    eigh = scipy.linalg.eigh

    def turned(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, vectors = eigh(matrix)
        return values, vectors * np.where(np.arange(len(values)) % 2, 1.0, -1.0)

    here = simulate(sensor, scene, path, 5).frames.readings
    monkeypatch.setattr(scipy.linalg, "eigh", turned)
    there = simulate(sensor, scene, path, 5).frames.readings
    # the rounding of the root of the smallest eigenvalues
    np.testing.assert_allclose(there, here, rtol=1e-7)


def test_noise_has_the_stated_covariance() -> None:
    """Bartlett bands of 5 standard errors on three moments: false alarms 2e-6."""
    noise = {"read": [1e-3, 2e-3], "shot": 1e-5, "relative": 0.02}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-8, "noise": noise})
    n = 40_000
    path = SampledTrajectory(range_m=[0.5] * n)
    scene = parse_scene({"object": OBJECT, "crosstalk": [0.01, 0.02]})
    readings = simulate(sensor, scene, path, 3).frames.readings
    quiet = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-8, "noise": TINY})
    mean = simulate(quiet, scene, SampledTrajectory(range_m=[0.5]), 3).frames.readings[0]
    signal = mean - [0.01, 0.02]
    v1, v2, v12 = covariance(
        (1e-3, 2e-3), 1e-5, 0.02, True, (mean[0], mean[1]), (signal[0], signal[1])
    )
    wanted = np.array([[v1, v12], [v12, v2]])
    found = np.cov(readings.T)
    for i in range(2):
        for j in range(2):
            error = math.sqrt((wanted[i, i] * wanted[j, j] + wanted[i, j] ** 2) / n)
            assert abs(found[i, j] - wanted[i, j]) < 5 * error
        assert abs(readings[:, i].mean() - mean[i]) < 5 * math.sqrt(wanted[i, i] / n)


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**40])
def test_units_of_the_readings_change_nothing(factor: float) -> None:
    def frames(unit: float) -> np.ndarray:
        noise = {"read": [1e-5 * unit, 1e-5 * unit], "shot": 1e-6 * unit, "relative": 0.01}
        sensor = parse_sensor(
            {"kind": "pulsed", "pulse_width_s": 1e-7, "gain": unit, "noise": noise}
        )
        wall = {**WALL, "strength": 0.02 * unit}
        scene = parse_scene(
            {"object": OBJECT, "background": wall, "crosstalk": [0.1 * unit, 0.2 * unit]}
        )
        return simulate(sensor, scene, PATH, 5).frames.readings

    np.testing.assert_allclose(frames(factor), factor * frames(1.0), rtol=1e-14)


def test_full_scale_empty_frames_and_amplitude() -> None:
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": TINY, "full_scale": [1.0, 1.0]}
    )
    path = SampledTrajectory(
        range_m=[0.05, 1.0, 1.0, 1.0],
        amplitude=[1.0, 1.0, 2.0, 1.0],
        object_present=[True, True, True, False],
    )
    scene = parse_scene({"object": OBJECT, "crosstalk": [0.0, 0.25]})
    simulation = simulate(sensor, scene, path, 1)
    w2 = simulation.frames.readings[:, 1]
    assert w2[0] == 1.0
    assert w2[2] - 0.25 == pytest.approx(2 * (w2[1] - 0.25))
    assert w2[3] == pytest.approx(0.25)
    assert np.isnan(simulation.range_m[3])


def test_frames_that_tell_their_ranges() -> None:
    """To what is stated, nothing else changed; 2000 draws, 5 sd of their spread."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-5]}}
    )
    scene = parse_scene({"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}})
    path = RadialTrajectory(from_m=0.5, to_m=2.0, frames=2000)
    plain = simulate(sensor, scene, path, 3)
    assert plain.frames.known_range_m is None
    told = simulate(sensor, scene, path.model_copy(update={"known_range_sd_m": 0.01}), 3)
    np.testing.assert_array_equal(told.frames.readings, plain.frames.readings)
    assert told.frames.known_range_m is not None
    off = (told.frames.known_range_m - told.range_m) / 0.01
    assert abs(off.mean()) < 5 / np.sqrt(2000)
    assert abs(off.std() - 1.0) < 5 / np.sqrt(4000)
    lists = SampledTrajectory(
        range_m=[1.0, 1.0, 1.0], object_present=[True, False, True],
        known_range_sd_m=[0.01, 0.01, None],
    )  # fmt: skip
    frames = simulate(sensor, scene, lists, 3).frames
    assert frames.known_range_m is not None
    assert np.isfinite(frames.known_range_m).tolist() == [True, False, False]
    check_frames(sensor, frames)
