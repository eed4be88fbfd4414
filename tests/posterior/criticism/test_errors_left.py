"""What an error of the model takes up pulls no unknown beyond its prior."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import CollapsedDensity
from inference.density.profile import linearise
from inference.posterior import fold
from inference.posterior.criticism.errors_left import errors_left
from inference.posterior.criticism.prior_conflict import prior_conflicts
from inference.posterior.settings import SamplerSettings
from simulator.model_error import ModelError
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

OBJECT = {"c0": 0.0245, "c1": 0.0302, "c2": 0.0443}
SHADOW = {"c0": 0.027, "c1": 0.001}
LOGNORMAL = {"prior": "lognormal", "median": 0.03, "sigma": 0.5}
EXACT = ModelError(flux=0.0, range_m=0.0, integrated=False)


def _set(seed: int, strength: dict[str, Any]) -> tuple[CollapsedDensity, ModelError]:
    """A known object before a wall, at a signal-to-noise ratio of ten thousand, its flux off."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}}
    )
    wall = {"strength": 0.03, "distance_m": 3.0, "shadow": SHADOW}
    truth = parse_scene({"object": OBJECT, "background": wall, "discrepancy": 0.03})
    path = RadialTrajectory(from_m=0.15, to_m=0.6, frames=10, spacing="log")
    frames = simulate(sensor, truth, path, seed).frames
    scene = parse_scene({"object": OBJECT, "background": {"strength": strength, "distance_m": 3.0}})
    job = fold.prepare(sensor, scene, frames, SamplerSettings(seed=1))
    return job.density(), scene.model_error


def _conflicts(density: CollapsedDensity, z: np.ndarray, error: ModelError) -> tuple[str, ...]:
    draws = np.tile(z, (3, 1))
    return prior_conflicts(density, draws, density.best_ranges(draws)[:, :, 0], density, error)


@pytest.mark.parametrize("seed", [1, 4])
def test_an_error_that_is_allowed_for_pulls_no_unknown_beyond_its_prior(seed: int) -> None:
    """The shadow's c1 stands where its prior ends, and the flux's error would have it lower."""
    density, error = _set(seed, LOGNORMAL)
    z = density.parameters.standard(np.array([[0.03, 0.027, 0.001]]))[0]
    assert z[2] < -2.0
    (reason,) = _conflicts(density, z, EXACT)
    assert "background.shadow.c1 piles up at the lower end" in reason
    assert _conflicts(density, z, error) == ()
    assert _conflicts(density, z, dataclasses.replace(error, shadow=0.0)) == ()


def test_a_prior_that_no_allowed_error_reconciles_is_still_named() -> None:
    """The wall gives thrice the light that its prior has room for."""
    density, error = _set(0, {"prior": "uniform", "low": 0.0, "high": 0.01})
    z = density.parameters.standard(np.array([[0.0099, 0.027, 0.02]]))[0]
    assert any("background.strength" in reason for reason in _conflicts(density, z, error))


def test_light_that_may_be_none_and_is_none_conflicts_with_no_half_normal_prior() -> None:
    """Half of a noise of 1e-6 lies five deviations towards the end at zero."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}}
    )
    light = {"prior": "halfnormal", "sd": 1.0}
    scene = parse_scene({"object": OBJECT, "crosstalk": [light, light]})
    path = RadialTrajectory(from_m=0.15, to_m=0.6, frames=10, spacing="log")
    frames = simulate(sensor, parse_scene({"object": OBJECT}), path, 1).frames
    job = fold.prepare(sensor, scene, frames, SamplerSettings(seed=1))
    density = job.density()
    z = density.parameters.standard(np.array([[3e-7, 5e-7]]))[0]
    assert (z < -4.9).all()
    assert _conflicts(density, z, scene.model_error) == ()


def test_errors_give_way_as_unknowns_with_standard_normal_priors_do() -> None:
    """What is left of readings that a single error made: 1 / (1 + its squared length)."""
    density, error = _set(0, LOGNORMAL)
    z = np.zeros(3)
    best = density.best_ranges(z[None])[0, :, 0]
    errors = errors_left(density, z, best, error)
    assert errors is not None
    one = errors[:, :, [0]]
    plain, found = linearise(density, z, best), linearise(density, z, best, one)
    # the change of residuals with the error, ranges giving way, is that with z of an unknown
    whole, left = np.square(plain.residual).sum(), np.square(found.residual).sum()
    assert left < whole
    # the part across all that the error can do stays as it is, however large the error is allowed
    larger = np.square(linearise(density, z, best, 1e3 * one).residual).sum()
    largest = np.square(linearise(density, z, best, 1e5 * one).residual).sum()
    assert larger <= left
    assert largest == pytest.approx(larger, rel=1e-3)
    assert errors_left(density, z, best, EXACT) is None
