"""How all follows errors of a shadow: by differences, and beside an error of the flux."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.identifiability.experiment import Experiment
from inference.identifiability.model_response import model_response
from inference.identifiability.range_response import shadow_response
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import sensor_of

WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 0.5},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.1},
    "shadow": {
        "c0": {"prior": "lognormal", "median": 0.05, "sigma": 0.5},
        "c1": {"prior": "normal", "mean": 0.0, "sd": 0.1},
    },
}
STEP = 1e-5
KINDS = ["pulsed", "sine_wave"]


def experiment(kind: str, discrepancy: float | None) -> Experiment:
    """A draw, its last frame without object."""
    scene = parse_scene({"background": WALL})
    sensor = sensor_of(kind, 1e3)
    parameters = parameters_of(sensor, scene)
    z = 0.3 * np.random.default_rng(3).standard_normal(len(parameters))
    log_r = np.append(np.log(np.geomspace(0.3, 1.5, 12)), np.nan)
    gain = np.linspace(0.5, 2.0, log_r.size)
    return Experiment(sensor, parameters, z, log_r, gain, discrepancy=discrepancy, shadow=0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_readings_with_errors_are_their_differences(kind: str) -> None:
    at = experiment(kind, 0.07)
    k = at.by_error.shape[2]
    error = 0.5 * np.random.default_rng(4).standard_normal((k,))
    at = dataclasses.replace(at, error=error)
    size = float(np.abs(at.readings.mean).max())

    def slope(above: dict[str, Any], below: dict[str, Any]) -> np.ndarray:
        ends = [dataclasses.replace(at, **values) for values in (above, below)]
        return np.asarray((ends[0].readings.mean - ends[1].readings.mean) / (2 * STEP))

    by_z = at.readings.by_term @ at.change
    for j in range(at.z.size):
        step = STEP * np.eye(at.z.size)[j]
        # central differences err as the step's square, and roundings as eps over the step
        expected = slope({"z": at.z + step}, {"z": at.z - step})
        np.testing.assert_allclose(by_z[:, :, j], expected, rtol=1e-5, atol=1e-8 * size)
    expected = slope({"log_r": at.log_r + STEP}, {"log_r": at.log_r - STEP})[:-1]
    np.testing.assert_allclose(at.readings.by_range[:-1], expected, rtol=1e-5, atol=1e-8 * size)
    for j in range(at.flux_errors, k):
        step = STEP * np.eye(k)[j]
        expected = slope({"error": error + step}, {"error": error - step})
        np.testing.assert_allclose(at.by_error[:, :, j], expected, rtol=1e-5, atol=1e-8 * size)


@pytest.mark.parametrize("kind", KINDS)
def test_flux_and_then_shadow_widen_as_both_at_once(kind: str) -> None:
    """Covariances of the linear model: that of a flux that errs, and what a shadow adds to it."""
    both = experiment(kind, 0.07)
    readings = both.readings.mean
    together = model_response(both, readings)
    flux = model_response(dataclasses.replace(both, shadow=0.0), readings)
    none = np.zeros(both.by_error.shape[2])
    of_z, of_log_r, _ = shadow_response(dataclasses.replace(both, error=none), readings)
    for all_of, first, then in (
        (together.parameters, flux.parameters, of_z[:, 1:]),
        (together.log_r, flux.log_r, of_log_r[:, 1:]),
    ):
        whole = all_of @ all_of.T
        scale = np.sqrt(np.outer(np.diag(whole), np.diag(whole))).max()
        np.testing.assert_allclose(first @ first.T + then @ then.T, whole, atol=1e-8 * scale)
    assert np.linalg.norm(of_log_r[:, 1:]) > 1e-3
