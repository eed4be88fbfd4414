"""Temperature coefficients as unknowns of posteriors."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.frame.sensitivity import sensitivity
from inference.identifiability.before_data import identifiability
from inference.posterior.answer.replicate import replicate
from inference.posterior.infer import infer
from inference.posterior.job import prepare
from inference.posterior.settings import SamplerSettings
from simulator.at_temperature import at_reference
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

NOISE = {"read": [2e-3, 2e-3]}
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 2e-8, "noise": NOISE},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE},
}
TRUE = (-3e-3, 2e-11)
PRIORS = {
    "gain_drift_per_k": {"prior": "normal", "mean": 0.0, "sd": 5e-3},
    "delay_drift_s_per_k": {"prior": "normal", "mean": 0.0, "sd": 5e-11},
}
NUMBERS = dict(zip(PRIORS, TRUE, strict=True))
SCENE: dict[str, Any] = {
    "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
    "crosstalk": [0.01, 0.02],
    "discrepancy": 0,
    "range_m": {"prior": "loguniform", "low": 0.2, "high": 1.5},
}
RANGES = np.array([0.35, 0.5, 0.8, 1.1, 0.6, 0.4])
KELVIN = np.array([270.0, 290.0, 310.0, 330.0, 285.0, 325.0])


def _told(kind: str, sd: float | None = None) -> tuple[Sensor, Sensor, Scene, Frames]:
    """Return a sensor of unknown drifts, the same with the truth, scene and frames."""
    unknown, known = (
        parse_sensor(KINDS[kind] | {"temperature": drifts}) for drifts in (PRIORS, NUMBERS)
    )
    scene = parse_scene(SCENE)
    path = SampledTrajectory(
        range_m=RANGES.tolist(),
        temperature_k=KELVIN.tolist(),
        known_range_sd_m=None if sd is None else [sd] * RANGES.size,
    )
    return unknown, known, scene, simulate(known, scene, path, 4).frames


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_at_the_truth_a_density_is_that_of_frames_at_the_reference(kind: str) -> None:
    unknown, known, scene, frames = _told(kind)
    of = collapsed_density(unknown, scene, frames)
    z = of.parameters.standard(np.array([TRUE]))
    cold, turned = at_reference(known, frames, (0.01, 0.02))
    there = collapsed_density(cold, scene, turned)
    wanted = there.log_likelihood(np.zeros((1, 0)))
    assert of.log_likelihood(np.repeat(z, 2, axis=0)) == pytest.approx(np.repeat(wanted, 2))
    # of known drifts as well
    of = collapsed_density(known, scene, frames)
    assert of.log_likelihood(np.zeros((1, 0))) == pytest.approx(wanted)
    found = of.best_ranges(np.zeros((1, 0)))
    assert found == pytest.approx(there.best_ranges(np.zeros((1, 0))))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_derivatives_along_the_drifts(kind: str) -> None:
    """Against central differences, which err by 1e-9 of themselves."""
    unknown, _, scene, frames = _told(kind)
    wall = {"strength": 0.05, "distance_m": 2.0, "shadow": {"c0": 0.06, "c1": 0.01}}
    scene = parse_scene(SCENE | {"background": wall})
    parameters = collapsed_density(unknown, scene, frames).parameters
    terms = parameters.terms(parameters.standard(np.array([TRUE])))
    log_r, gain = np.append(np.log(RANGES), np.nan), np.ones((RANGES.size + 1, 2))
    gain[:, 1] = np.append(KELVIN, 320.0) - 298.15
    of = sensitivity(unknown, terms, log_r, gain).by_term
    assert of.shape[2] == 13
    assert terms.drift is not None
    for column, size in ((0, 1e-6), (1, 1e-14)):
        pair = []
        for h in (size, -size):
            drift = terms.drift.copy()
            drift[0, column] += h
            moved = dataclasses.replace(terms, drift=drift)
            pair.append(sensitivity(unknown, moved, log_r, gain).mean)
        wanted = (pair[0] - pair[1]) / (2 * size)
        assert of[:, :, 11 + column] == pytest.approx(wanted, abs=1e-7 * np.abs(wanted).max())


def test_replicated_readings_are_those_of_the_simulator() -> None:
    """Means of 400 within 5 standard errors: by chance in 7e-6 of runs."""
    _, known, scene, frames = _told("sine_wave")
    density = collapsed_density(known, scene, frames)
    z, positions = np.zeros((400, 0)), np.broadcast_to(np.log(RANGES), (400, RANGES.size)).copy()
    drawn = replicate(density, z, positions, np.random.default_rng(3))
    silent = known.model_copy(
        update={"noise": known.noise.model_copy(update={"read": (1e-30, 1e-30)})}
    )
    path = SampledTrajectory(range_m=RANGES.tolist(), temperature_k=KELVIN.tolist())
    wanted = simulate(silent, scene, path, 1).frames.readings
    assert np.abs(drawn.mean(axis=0) - wanted).max() < 5 * 2e-3 / 20


def test_known_ranges_at_different_temperatures_tell_the_drifts() -> None:
    """The truth within 5 standard deviations of two unknowns: by chance in 1e-6 of data."""
    unknown, _, scene, frames = _told("pulsed", 1e-4)
    assert frames.temperature_k is not None
    frames.temperature_k[2] = np.nan  # which is left out
    settings = SamplerSettings(method="importance", target_ess=150, ensembles=2, seed=1)
    found = infer(unknown, scene, frames, settings)
    assert found.verdict.converged
    for name, value in zip(PRIORS, TRUE, strict=True):
        row = found.parameters[f"sensor.temperature.{name}"]
        assert abs(row.mean - value) < 5 * row.sd
    status = {row.parameter: row.status for row in found.identifiability}
    assert status["sensor.temperature.delay_drift_s_per_k"] == "identified"


def test_one_temperature_does_not_tell_them() -> None:
    unknown, _, scene, _ = _told("sine_wave")
    known = [1e-4] * RANGES.size
    same = identifiability(
        unknown, scene, RANGES.tolist(), known_range_sd_m=known, temperature_k=[298.15] * 6
    )
    assert {
        row.parameter: row.status for row in same.identifiability if "drift" in row.parameter
    } == {f"sensor.temperature.{name}": "not_identified" for name in PRIORS}
    spread = identifiability(
        unknown, scene, RANGES.tolist(), known_range_sd_m=known, temperature_k=KELVIN.tolist()
    )
    assert spread.information.rank == same.information.rank + 2
    assert spread.sd["sensor.temperature.delay_drift_s_per_k"] < 5e-11 / 10  # of its prior
    with pytest.raises(InvalidInputError, match="5 entries"):
        identifiability(unknown, scene, RANGES.tolist(), temperature_k=[300.0] * 5)


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_the_density_does_not_depend_on_units_of_reading(unit: float) -> None:
    for kind in KINDS:
        unknown, _, scene, frames = _told(kind)
        there = parse_sensor(
            KINDS[kind]
            | {"temperature": PRIORS, "gain": unit, "noise": {"read": [2e-3 * unit, 2e-3 * unit]}}
        )
        light = parse_scene(SCENE | {"crosstalk": [0.01 * unit, 0.02 * unit]})
        scaled = dataclasses.replace(frames, readings=frames.readings * unit)
        z = np.linspace(-0.3, 0.3, 5)[:, None] * [1.0, -1.0]
        here = collapsed_density(unknown, scene, frames)(z)
        moved = collapsed_density(there, light, scaled)(z)
        assert moved - moved[0] == pytest.approx(here - here[0], abs=1e-6)


def test_a_posterior_without_any_temperature_is_refused() -> None:
    unknown, _, scene, frames = _told("pulsed")
    nothing = dataclasses.replace(frames, temperature_k=np.full(RANGES.size, np.nan))
    with pytest.raises(RefusedError, match="temperature_k is null"):
        prepare(unknown, scene, nothing, SamplerSettings(seed=1))


def test_of_no_draws_there_are_no_densities() -> None:
    """As of a posterior that is stopped before it draws."""
    unknown, _, scene, frames = _told("pulsed")
    for motion in ("radial", "static"):
        stated = scene.model_copy(update={"motion": motion})
        density = prepare(unknown, stated, frames, SamplerSettings(seed=1)).density()
        assert density(np.empty((0, len(density.parameters)))).shape == (0,)
