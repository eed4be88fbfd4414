"""The linear response to errors of the model, against all unknowns solved at once."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from inference.density.whitened import whitened
from inference.frame.sensitivity import whiteners
from inference.identifiability.expected_posterior import expected_posterior
from inference.identifiability.experiment import Experiment
from inference.identifiability.model_response import (
    FluxTold,
    ModelResponse,
    common_pull,
    curvature_of_response,
    model_response,
)
from inference.identifiability.response_rows import ResponseRows, flux_step
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import UNKNOWN_CROSSTALK, sensor_of

Array = NDArray[np.float64]

SUPPORT = {"prior": "reference", "low": 0.02, "high": 15.0}


def experiment(
    kind: str, snr: float, discrepancy: float = 0.07, range_m: object = SUPPORT, *, empty: int = 0
) -> Experiment:
    sensor = sensor_of(kind, snr)
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK, "range_m": range_m})
    log_r = np.append(np.log(np.geomspace(0.3, 1.5, 15)), np.full(empty, np.nan))
    z = np.array([0.2, -0.1, 0.3, 0.1, 0.05])
    return Experiment(sensor, parameters_of(sensor, scene), z, log_r, discrepancy=discrepancy)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("snr", [100.0, 1e4])
def test_spread_and_response_together_are_the_error_integrated_out(kind: str, snr: float) -> None:
    """The identity of block inverses; what the support leaves open adds 1e-4 of the precision."""
    at = experiment(kind, snr, empty=3)
    found, wanted = model_response(at, at.readings.mean), expected_posterior(at)
    z = np.hypot(found.sd, np.linalg.norm(found.parameters, axis=1))
    assert z == pytest.approx(wanted.sd[: z.size], rel=1e-3)
    log_r = np.sqrt(found.own**2 + found.shared**2 + np.square(found.log_r).sum(axis=1))
    present = np.isfinite(at.log_r)
    assert log_r[present] == pytest.approx(wanted.range_sd[present], rel=1e-3)
    assert np.all(log_r[~present] == 0.0)


@pytest.mark.parametrize("range_m", [SUPPORT, {"prior": "normal", "mean": 0.8, "sd": 1e-3}])
def test_the_shift_is_that_of_all_unknowns_solved_at_once(range_m: dict[str, object]) -> None:
    at = experiment("pulsed", 1000.0, range_m=range_m)
    rng = np.random.default_rng(3)
    n, d, k = at.log_r.size, at.z.size, at.by_error.shape[2]
    readings = at.readings.mean * (1.0 + 0.02 * rng.standard_normal((n, 1)))
    frames = np.column_stack([readings, np.ones(n)])
    of = whitened(at.sensor, at.parameters, frames, at.z, at.log_r)
    errors = np.einsum("nij,njk->nik", of.whitener, at.by_error)
    blocks = np.zeros((n, 2, n))
    blocks[np.arange(n), :, np.arange(n)] = of.along
    prior, r = at.range_prior, np.exp(at.log_r)
    rows = np.concatenate([of.jacobian, blocks, errors], axis=2).reshape(2 * n, -1)
    held = np.zeros((d + n + k, d + n + k))
    held[np.arange(d + n + k), np.arange(d + n + k)] = [
        *np.ones(d),
        *np.full(n, r * prior.inverse_sd),
        *np.ones(k),
    ]
    pull = np.concatenate([-at.z, (prior.mean - r) * prior.inverse_sd, np.zeros(k)])
    whole, target = np.concatenate([rows, held]), np.append(of.residual.ravel(), pull)
    integrated = np.linalg.lstsq(whole, target, rcond=None)[0][: d + n]
    exact = np.linalg.lstsq(whole[:, : d + n], target, rcond=None)[0]
    found = model_response(at, readings).shift
    wanted = integrated - exact
    size = np.abs(wanted[d:]).max()
    assert found[0] == pytest.approx(wanted[:d], abs=1e-3 * np.abs(wanted[:d]).max())
    assert found[1] == pytest.approx(wanted[d:], abs=1e-3 * size)


def test_a_small_error_is_followed_to_second_order() -> None:
    """Half the error misses by a quarter."""
    at, rng = experiment("pulsed", 1000.0), np.random.default_rng(5)
    found = model_response(at, at.readings.mean)
    still = np.zeros(found.error.mean.size)
    none = FluxTold(still, np.eye(still.size))
    follow = _by_coefficients(found)
    found = dataclasses.replace(found, shift=(0 * at.z, 0 * at.log_r), error=none, **follow)
    coefficients = rng.standard_normal(still.size)
    missed = curvature_of_response(at, found, np.outer([0.04, 0.02], coefficients))
    assert missed[1] / missed[0] == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_errors_tried_together_are_each_followed_alone(kind: str) -> None:
    """By the readings where an error leads, and one Gauss-Newton step back, error and all."""
    at = experiment(kind, 100.0, empty=2)
    of = model_response(at, at.readings.mean)
    normal = np.random.default_rng(6).standard_normal((3, of.log_r.shape[1]))
    wanted = []
    for one in normal:
        z, log_r = of.shift[0] + of.parameters @ one, of.shift[1] + of.log_r @ one
        error = of.error.mean + of.error.spread @ one
        there = dataclasses.replace(at, z=at.z + z, log_r=at.log_r + log_r, error=error)
        rows = ResponseRows(at)
        off = rows.residual(2.0 * at.readings.mean - there.readings.mean)
        off += rows.by_error @ error + rows.jacobian @ z + rows.along * log_r[:, None]
        off[:, 2] = 0.0
        step = flux_step(rows, off, np.zeros(z.size))
        again = step.by_readings[1] + step.by_error[1] @ step.coefficients(np.zeros(error.size))
        wanted.append(np.sqrt(np.mean(np.square(again[np.isfinite(at.log_r)]))))
    np.testing.assert_allclose(curvature_of_response(at, of, normal), wanted, rtol=1e-6)


def _by_coefficients(found: ModelResponse) -> dict[str, Array]:
    """Return the response to the error's own coefficients."""
    back = np.linalg.inv(found.error.spread)
    return {"parameters": found.parameters @ back, "log_r": found.log_r @ back}


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_steps_settle_where_the_error_integrated_out_has_its_mode(kind: str) -> None:
    """From where the exact model would be, hundreds of standard deviations off."""
    at = experiment(kind, 1e4, empty=3)
    size, d, n = at.by_error.shape[2], at.z.size, 15
    error = np.asarray(1.5 * np.random.default_rng(2).standard_normal(size))
    readings = dataclasses.replace(at, error=error, z=at.z + 0.3).readings.mean
    whitener = whiteners(at.sensor, at.readings)

    def off(x: Array) -> Array:
        z, coefficients, log_r = x[:d], x[d : d + size], np.append(x[d + size :], [np.nan] * 3)
        mean = dataclasses.replace(at, z=z, log_r=log_r, error=coefficients).readings.mean
        return np.append(np.einsum("nij,nj->ni", whitener, readings - mean).ravel(), x[: d + size])

    start = np.concatenate([at.z, np.zeros(size), at.log_r[:n]])
    wanted = least_squares(off, start, x_scale="jac", max_nfev=100).x
    first = model_response(at, readings)
    found = model_response(at, readings, first.followed)
    way = wanted[d + size :] - at.log_r[:n]
    assert np.abs(first.shift[1][:n] - way).max() > 0.3 * np.abs(way).max()
    assert found.shift[1][:n] == pytest.approx(way, abs=0.02 * np.abs(way).max())
    assert at.z + found.shift[0] == pytest.approx(wanted[:d], abs=0.03)
    assert found.error.mean == pytest.approx(wanted[d : d + size], abs=0.03)


def test_noise_of_draws_pulls_nothing() -> None:
    """The mean of 400 draws about one mode is off by a twentieth of each: five of 1 or less."""
    at, rng = experiment("pulsed", 1000.0), np.random.default_rng(4)
    noise = rng.standard_normal((400, 3 * at.log_r.size + at.z.size))
    found = model_response(at, at.readings.mean)
    assert not common_pull([dataclasses.replace(found, followed=row) for row in noise]).any()
    pulled = [dataclasses.replace(found, followed=row + 10.0) for row in noise]
    assert common_pull(pulled) == pytest.approx(10.0, abs=0.3)


def test_a_range_that_the_prior_tells_does_not_follow() -> None:
    free = experiment("pulsed", 30.0)
    told = experiment("pulsed", 30.0, range_m={"prior": "normal", "mean": 0.6, "sd": 1e-6})
    assert np.all(model_response(free, free.readings.mean).told > 0.9)
    found = model_response(told, told.readings.mean)
    assert np.all(found.told < 1e-2)
    assert np.abs(found.log_r).max() < 1e-3 * np.abs(found.parameters).max()


def test_a_step_that_leads_beyond_all_ranges_is_not_taken() -> None:
    """Far frames whose light is gone: steps went on to where a range overflows, and none ended."""
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [6.8e-6, 6.8e-6]}}
    )
    unknown = {"prior": "normal", "mean": 0.0, "sd": 7.6e-4}
    thing = {"c0": 0.0263, "c1": 0.0, "c2": 0.1131}
    parameters = parameters_of(sensor, parse_scene({"crosstalk": [unknown] * 2, "object": thing}))
    log_r = np.append(np.linspace(-1.69, -0.39, 16), [1.65, 1.5, 1.43, 1.39])
    at = Experiment(sensor, parameters, np.array([13.9, 21.4]), log_r, discrepancy=0.02)
    readings = at.readings.mean.copy()
    gone = [[2.7, -6.5], [-1.1, -8.6], [-3.8, -10.3], [-5.8, -11.6]]
    readings[-4:] += 1e-3 * np.array(gone)
    first = model_response(at, readings)
    found = model_response(at, readings, first.followed)
    assert np.isfinite(found.shift[1]).all()
    assert np.isfinite(found.shift[0]).all()
    none = np.zeros((1, first.error.mean.size))
    assert curvature_of_response(at, first, none)[0] > 1.0
