"""Checks of the fit: rarely false, and each fires on what it is for."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.posterior.answer.fit import Fit
from inference.posterior.criticism.predictive_check import predictive_check
from inference.posterior.job import prepare
from inference.posterior.sampling.start import Optimum, refine
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

Array = NDArray[np.float64]

TRUTH: dict[str, Any] = {"crosstalk": [0.002, 0.01]}


def checked(sensor: Sensor, scene: Scene, frames: Frames, seed: int = 0) -> Fit:
    """Check at draws from the Laplace approximation around the truth."""
    job = prepare(sensor, scene, frames, SamplerSettings(seed=seed))
    density = job.density()
    rng = np.random.default_rng(seed)
    names = density.parameters.names
    if not names:
        return predictive_check(job, density, np.empty((5, 0)), rng)
    values = {f"object.{name}": value for name, value in OBJECT.items()}
    columns = (f"crosstalk.{column}" for column in sensor.columns)
    values |= dict(zip(columns, TRUTH["crosstalk"], strict=True))
    truth = density.parameters.standard(np.array([[values[name] for name in names]]))[0]
    optimum = refine(density, truth)
    assert isinstance(optimum, Optimum)
    z = optimum.z + rng.standard_normal((5, len(names))) @ optimum.factor.T
    return predictive_check(job, density, z, rng)


def scene_of(crosstalk: bool, discrepancy: float | None = None) -> Scene:
    scene: dict[str, Any] = {"crosstalk": UNKNOWN_CROSSTALK} if crosstalk else {}
    return parse_scene(scene if discrepancy is None else {**scene, "discrepancy": discrepancy})


@functools.cache
def healthy(kind: str, crosstalk: bool, snr: float, sets: int) -> tuple[float, ...]:
    sensor = sensor_of(kind, snr)
    truth = TRUTH if crosstalk else {}
    return tuple(
        checked(sensor, scene_of(crosstalk), data(sensor, truth, 20, seed).frames, seed).p_value
        for seed in range(sets)
    )


@pytest.mark.parametrize(
    ("kind", "crosstalk", "snr"),
    [
        ("pulsed", True, 1000.0),
        pytest.param("sine_wave", False, 30.0, marks=pytest.mark.thorough),
    ],
)
def test_false_alarms_are_as_rare_as_stated(kind: str, crosstalk: bool, snr: float) -> None:
    """At 5 % and 20 %, binomial bands of 1e-3 each: p errs towards fewer alarms. That it is so
    down to 1e-3 is measured by `python -m benchmarks.fit_check`."""
    sets = 60
    found = np.array(healthy(kind, crosstalk, snr, sets))
    for level in (0.05, 0.2):
        assert np.sum(found < level) <= stats.binom.isf(1e-3, sets, level)
    assert found.min() > 1e-3 / sets  # a misfit that were sure would be a fault


def wobble(amplitude: float) -> Callable[[Array, Array], Array]:
    def spoil(readings: Array, r: Array) -> Array:
        return np.asarray(readings * (1 + amplitude * np.sin(3 * np.log(r)))[:, None])

    return spoil


def one_off(readings: Array, _: Array) -> Array:
    return np.asarray(readings * (1 + 0.02 * (np.arange(len(readings)) == 7))[:, None])


@pytest.mark.parametrize(
    ("spoil", "check"), [(wobble(0.02), "wander"), (one_off, "worst_frame")], ids=["smooth", "one"]
)
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_what_is_wrong_is_named(
    kind: str, spoil: Callable[[Array, Array], Array], check: str
) -> None:
    sensor = sensor_of(kind)
    frames = data(sensor, frames=40).frames
    spoilt = dataclasses.replace(
        frames, readings=spoil(frames.readings, np.geomspace(0.1, 2.0, 40))
    )
    fit = checked(sensor, scene_of(False, 0), spoilt)
    assert fit.misfit
    assert fit.p_value < 1e-3
    assert fit.reasons
    (found,) = (part for part in fit.checks if part.name == check)
    assert found.p_value < 2.5e-4
    if check == "worst_frame":
        assert fit.outliers == (7,)
        assert any("frames" in reason and "7" in reason for reason in fit.reasons)
    else:
        assert any("discrepancy" in reason for reason in fit.reasons)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_an_error_of_the_default_size_is_no_misfit_and_a_gross_one_is(kind: str) -> None:
    """A scene that says nothing allows for 7 % of the flux, not for ten times as much, and not for
    a frame that is off on its own."""
    sensor, scene, at = sensor_of(kind), scene_of(False), np.geomspace(0.1, 2.0, 40)
    frames = data(sensor, frames=40).frames
    for spoil, wrong in (
        (wobble(0.05), None),
        (wobble(0.8), "flux_error"),
        (one_off, "worst_frame"),
    ):
        spoilt = dataclasses.replace(frames, readings=spoil(frames.readings, at))
        fit = checked(sensor, scene, spoilt)
        assert fit.misfit == (wrong is not None)
        failed = {check.name for check in fit.checks if check.p_value < 2e-4}
        assert wrong is None or wrong in failed


def test_the_limit_of_a_misfit_is_one_in_a_thousand() -> None:
    """Of noise that is less and less what is stated; p is that of the worst of all checks."""
    seen = []
    for factor in (1.3, 1.5, 1.6, 1.8):
        told, real = sensor_of("pulsed", factor * 1000.0), sensor_of("pulsed", 1000.0)
        fit = checked(told, scene_of(False, 0), data(real, frames=40).frames)
        least = min(check.p_value for check in fit.checks)
        assert fit.p_value == pytest.approx(1.0 - (1.0 - least) ** len(fit.checks), rel=1e-6)
        assert fit.misfit == (fit.p_value < 1e-3)
        assert bool(fit.reasons) == fit.misfit
        seen.append(fit.p_value)
    assert seen == sorted(seen, reverse=True)
    assert seen[0] > 1e-3
    assert any(1e-7 < p < 1e-3 for p in seen)


def test_noise_larger_than_stated_is_a_misfit() -> None:
    told, real = sensor_of("pulsed", 2000.0), sensor_of("pulsed", 1000.0)
    fit = checked(told, scene_of(False, 0), data(real, frames=40).frames)
    assert fit.misfit
    assert fit.chi_square > 2 * fit.degrees_of_freedom
    assert any("chi-square" in reason for reason in fit.reasons)


@pytest.mark.parametrize("crosstalk", [False, True])
def test_degrees_of_freedom_are_frames_less_parameters(crosstalk: bool) -> None:
    """A frame is two readings and one range. The mean of 1000 chi-squares of 15 has an error of
    sqrt(2 * 15 / 1000); a parameter that the prior helps to fix costs less than one."""
    sensor = sensor_of("pulsed")
    frames = data(sensor, TRUTH if crosstalk else {}, 20).frames
    freedom = checked(sensor, scene_of(crosstalk, 0), frames).degrees_of_freedom
    assert freedom == pytest.approx(15 if crosstalk else 17, abs=5 * 0.18 + 0.5)


def test_known_parameters_and_empty_frames() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, TRUTH, 8).frames
    rng = np.random.default_rng(220)
    bare = np.array([0.002, 0.01]) + sensor.noise.read[0] * rng.standard_normal((4, 2))
    told = Frames(np.concatenate([frames.readings, bare]), object_present=np.arange(12) < 8)
    scene = parse_scene({"object": OBJECT, "discrepancy": 0} | TRUTH)
    fit = checked(sensor, scene, told)
    assert not fit.misfit
    assert fit.degrees_of_freedom == pytest.approx(8 + 2 * 4, abs=1.0)
    shift = np.where(np.arange(12) == 9, 1e-3, 0.0)[:, None]
    off = dataclasses.replace(told, readings=told.readings + shift)
    spoilt = checked(sensor, scene, off)
    assert spoilt.misfit
    assert spoilt.outliers == (9,)


def test_few_frames_have_nothing_to_check() -> None:
    """Two readings, a range and an amplitude: whatever is read can be explained."""
    sensor = sensor_of("pulsed")
    scene = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}})
    fit = checked(sensor, scene, data(sensor, frames=1).frames)
    assert not fit.misfit
    assert fit.degrees_of_freedom < 0.1


def test_one_range_for_all_frames() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, frames=12, span=(0.7, 0.7000001)).frames
    scene = parse_scene({"object": OBJECT, "motion": "static"})
    fit = checked(sensor, scene, frames)
    assert not fit.misfit
    # twice twelve readings, one range
    assert fit.degrees_of_freedom == pytest.approx(23, abs=1.2)
    moved = data(sensor, frames=12, span=(0.7, 0.71)).frames
    assert checked(sensor, scene, moved).misfit


def test_an_error_that_the_scene_allows_is_no_misfit() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, frames=20).frames
    readings = wobble(0.02)(frames.readings, np.geomspace(0.1, 2.0, 20))
    job = prepare(
        sensor,
        parse_scene({"object": OBJECT, "discrepancy": 0.05}),
        dataclasses.replace(frames, readings=readings),
        SamplerSettings(seed=1),
    )
    rng = np.random.default_rng(221)
    fit = predictive_check(job, job.density(), np.empty((5, 0)), rng)
    assert not fit.misfit
    # the error takes some of twenty
    assert 5 < fit.degrees_of_freedom < 20
    noisy = dataclasses.replace(frames, readings=one_off(readings, readings))
    job = dataclasses.replace(job, frames=noisy)
    spoilt = predictive_check(job, job.density(), np.empty((5, 0)), rng)
    assert spoilt.misfit
    assert 7 in spoilt.outliers
