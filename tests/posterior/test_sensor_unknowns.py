"""Sensors that are not calibrated: gain, phase offset and timing offset as unknowns."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.frame.sensitivity import sensitivity
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings

Array = NDArray[np.float64]

NOISE = {"read": [2e-3, 2e-3]}
PULSE = {"kind": "pulsed", "pulse_width_s": 2e-8, "noise": NOISE}
WAVE = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE}
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SCENE: dict[str, Any] = {
    "object": OBJECT,
    "discrepancy": 0,
    "range_m": {"prior": "loguniform", "low": 0.2, "high": 1.5},
}
RANGES = np.array([0.35, 0.5, 0.8, 1.1])
GAIN = {"prior": "lognormal", "median": 1.0, "sigma": 0.2}
PHASE = {"prior": "normal", "mean": 0.1, "sd": 0.2}
TIMING = {"prior": "normal", "mean": 0.0, "sd": 3e-10}
CASES: dict[str, tuple[dict[str, Any], str, float]] = {
    "gain": (PULSE | {"gain": GAIN}, "gain", 1.15),
    "phase": (WAVE | {"phase_offset_rad": PHASE}, "phase_offset_rad", 0.25),
    "timing": (PULSE | {"timing_offset_s": TIMING}, "timing_offset_s", 2.5e-10),
}


def _told(sensor: dict[str, Any], name: str, value: float) -> tuple[Sensor, Sensor, Scene, Frames]:
    """Return sensor, the same with the truth for its unknown, scene, and frames."""
    scene = parse_scene(SCENE)
    true = parse_sensor(sensor | {name: value})
    terms = parameters_of(true, scene).terms(np.zeros((1, 0)))
    noise = 2e-3 * np.random.default_rng(4).standard_normal((RANGES.size, 2))
    return parse_sensor(sensor), true, scene, Frames(mean_readings(true, terms, RANGES) + noise)


def _means(sensor: dict[str, Any], name: str, value: float, r: Array) -> Array:
    """Return mean readings, shape (n, 2), by the equations themselves."""
    gain = value if name == "gain" else 1.0
    c0, c1, c2 = (OBJECT[key] for key in ("c0", "c1", "c2"))
    flux = gain * c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
    if sensor["kind"] == "pulsed":
        late = value if name == "timing_offset_s" else 0.0
        share = np.clip((2 * r / SPEED_OF_LIGHT + late) / sensor["pulse_width_s"], 0.0, 1.0)
        return np.column_stack([flux * share, flux])
    phase = 4 * np.pi * sensor["frequency_hz"] * r / SPEED_OF_LIGHT + value
    return np.column_stack([flux * np.cos(phase), flux * np.sin(phase)])


def _by_quadrature(density: CollapsedDensity, sensor: dict[str, Any], name: str) -> Array:
    """Return values of the unknown and their share, shape (2, points): sums over fine grids."""
    r = np.exp(np.linspace(np.log(0.2), np.log(1.5), 6001))
    z = np.linspace(-4.0, 4.0, 801)[:, None]
    values = density.parameters.natural(z)[:, 0]
    log_density = -0.5 * z[:, 0] ** 2
    for k, value in enumerate(values):
        off = (density.frames[:, None, :2] - _means(sensor, name, value, r)) / 2e-3
        square = -0.5 * np.square(off).sum(axis=2)
        best = square.max(axis=1)
        log_density[k] += np.sum(best + np.log(np.exp(square - best[:, None]).sum(axis=1)))
    share = np.exp(log_density - log_density.max())
    return np.stack([values, share / share.sum()])


@pytest.mark.parametrize("case", sorted(CASES))
@pytest.mark.parametrize(
    "method", [pytest.param("emcee", marks=pytest.mark.thorough), "importance"]
)
def test_the_posterior_of_one_unknown_is_that_of_quadrature(case: str, method: Any) -> None:
    """Mean within 6 of its Monte Carlo standard errors: by chance in 2e-9 of draws."""
    document, name, true = CASES[case]
    sensor, _, scene, frames = _told(document, name, true)
    settings = SamplerSettings(method=method, target_ess=150, ensembles=2, seed=1)
    found = infer(sensor, scene, frames, settings)
    row = found.parameters[f"sensor.{name}"]
    values, share = _by_quadrature(collapsed_density(sensor, scene, frames), document, name)
    mean = float(values @ share)
    sd = float(np.sqrt(np.square(values - mean) @ share))
    assert found.verdict.converged
    assert row.mean == pytest.approx(mean, abs=6 * row.mcse_mean)
    # of n independent draws a standard deviation errs by its share of 1 / sqrt(2 n)
    assert row.sd == pytest.approx(sd, rel=6 / np.sqrt(2 * row.ess_bulk))


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_the_density_does_not_depend_on_units_of_reading(unit: float) -> None:
    for document, name, true in CASES.values():
        sensor, _, scene, frames = _told(document, name, true)
        other = document | {"noise": {"read": [2e-3 * unit, 2e-3 * unit]}}
        if name == "gain":
            other["gain"] = GAIN | {"median": unit}
        else:
            other["gain"] = unit
        scaled = Frames(frames.readings * unit)
        z = np.linspace(-1.5, 1.5, 7)[:, None]
        here, there = (
            collapsed_density(one, scene, read)(z)
            for one, read in ((sensor, frames), (parse_sensor(other), scaled))
        )
        assert there - there[0] == pytest.approx(here - here[0], abs=1e-6)


@pytest.mark.parametrize("case", sorted(CASES))
def test_what_is_unknown_does_what_it_does_as_a_number(case: str) -> None:
    document, name, true = CASES[case]
    sensor, known, scene, frames = _told(document, name, true)
    unknown = collapsed_density(sensor, scene, frames)
    number = collapsed_density(known, scene, frames)
    z = unknown.parameters.standard(np.array([[true]]))
    assert unknown.log_likelihood(z) == pytest.approx(number.log_likelihood(np.zeros((1, 0))))


@pytest.mark.parametrize("case", sorted(CASES))
def test_derivatives_along_the_sensors_unknowns(case: str) -> None:
    """Against central differences, which err by 1e-9 of the readings at steps of 1e-6."""
    document, name, true = CASES[case]
    wall = {"strength": 0.05, "distance_m": 2.0, "shadow": {"c0": 0.06, "c1": 0.01}}
    scene = parse_scene(SCENE | {"background": wall, "crosstalk": [0.01, 0.02]})
    sensor = parse_sensor(document)
    parameters = parameters_of(sensor, scene)
    z = parameters.standard(np.array([[true]]))
    terms = parameters.terms(z)
    log_r = np.append(np.log(RANGES), np.nan)
    column = 9 if name == "gain" else 10
    of = sensitivity(sensor, terms, log_r).by_term[:, :, column]
    step = 1e-6
    if terms.gain is not None:
        pair = [dataclasses.replace(terms, gain=terms.gain * np.exp(h)) for h in (step, -step)]
    else:
        assert terms.lag is not None
        pair = [dataclasses.replace(terms, lag=terms.lag + h) for h in (step, -step)]
    up, down = (sensitivity(sensor, each, log_r).mean for each in pair)
    assert of == pytest.approx((up - down) / (2 * step), abs=1e-9)


def test_a_prior_without_mass_is_refused_at_its_place() -> None:
    with pytest.raises(InvalidInputError) as error:
        parse_sensor(PULSE | {"gain": {"prior": "uniform", "low": -2.0, "high": -1.0}})
    assert [problem.pointer for problem in error.value.problems] == ["/gain"]
    with pytest.raises(InvalidInputError) as error:
        parse_sensor(WAVE | {"phase_offset_rad": {"prior": "normal", "mean": 0.0, "sd": -1.0}})
    assert [problem.pointer for problem in error.value.problems] == ["/phase_offset_rad/sd"]
    with pytest.raises(InvalidInputError) as error:
        parse_sensor(WAVE | {"timing_offset_s": 1e-9})
    assert [problem.pointer for problem in error.value.problems] == ["/timing_offset_s"]
