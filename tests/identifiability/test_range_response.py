"""How all follows errors of the clock where ranges are known, against all unknowns at once."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.frame.delayed import delayed
from inference.frame.sensitivity import whiteners
from inference.identifiability.expected_posterior import told_rows
from inference.identifiability.experiment import Experiment
from inference.identifiability.range_response import range_response
from simulator.discrepancy import discrepancy_basis
from simulator.parameters import parameters_of, with_offset
from simulator.scene import parse_scene
from simulator.sensor import instrument
from tests.posterior.scenes import UNKNOWN_CROSSTALK, sensor_of

Array = NDArray[np.float64]

SIZE = 8e-4  # m
SUPPORT = {"prior": "reference", "low": 0.02, "high": 15.0}


def experiment(kind: str, rates: Array) -> Experiment:
    """A draw with an error of the flux, its last frame without object."""
    sensor = sensor_of(kind, 1e4)
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK, "range_m": SUPPORT})
    parameters = with_offset(parameters_of(sensor, scene), np.array([0.0, 0.5]))
    log_r = np.append(np.log(np.geomspace(0.3, 1.5, len(rates) - 1)), np.nan)
    z = np.array([0.2, -0.1, 0.3, 0.1, 0.05, 0.2])
    at = Experiment(sensor, parameters, z, log_r, discrepancy=0.07, rates=rates)
    error = np.asarray(0.5 * np.random.default_rng(1).standard_normal(at.by_error.shape[2]))
    return dataclasses.replace(at, error=error)


def rates_of(what: str) -> Array:
    rates = np.zeros((11, 2))
    if what == "two ranges":
        rates[[0, 9], 0] = 1.0 / 5e-4
    else:
        rates[:10:3, 1] = 1.0 / 3e-4
    return rates


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("what", ["two ranges", "odometry"])
def test_all_follow_a_wrong_clock_as_if_all_were_solved_at_once(kind: str, what: str) -> None:
    """Readings made with an error of the clock: what moves beside ranges is the right part.

    The exact clock's answer and that with the error as unknown, both by least squares over z,
    flux, clock and all ranges together.
    """
    at = experiment(kind, rates_of(what))
    assert at.error is not None
    present = np.isfinite(at.log_r)
    basis = discrepancy_basis(*at.parameters.reach_m)
    values = basis.values(np.where(present, at.log_r, 0.0)) * present[:, None]
    late = delayed(at.readings.signal, at.log_r, *instrument(at.sensor)) * present[:, None]
    late = SIZE * np.einsum("nij,nj->ni", whiteners(at.sensor, at.readings), late)
    clock = np.zeros((11, 5, basis.size))
    clock[:, :2] = late[:, :, None] * values[:, None]
    jacobian, along, _ = told_rows(at)
    d, j, k = at.z.size, jacobian.shape[2], basis.size
    along[:, 2] = 0.0  # the support of the prior: below 1e-4 of what is told
    ranges = np.zeros((11, 5, 11))
    ranges[np.arange(11), :, np.arange(11)] = along
    whole = np.concatenate([jacobian, ranges[:, :, :10], clock], axis=2).reshape(-1, j + 10 + k)
    held = np.eye(j + 10 + k)[np.r_[:j, j + 10 : j + 10 + k]]
    coefficients = np.random.default_rng(2).standard_normal(k)
    readings = np.column_stack([at.readings.mean, at.told])
    change = np.einsum(
        "nij,nj->ni",
        np.linalg.inv(whiteners(at.sensor, at.readings)),
        np.einsum("nik,k->ni", clock[:, :2], coefficients),
    )
    readings[:, :2] += change
    pull = np.concatenate([-at.z, -at.error, np.zeros(k)])
    off = np.zeros((11, 5))
    off[:, :2] = np.einsum("nij,nj->ni", whiteners(at.sensor, at.readings), change)
    target = np.append(off.ravel(), pull)
    rows = np.concatenate([whole, held])
    with_clock = np.linalg.lstsq(rows, target, rcond=None)[0][: j + 10]
    exact = np.linalg.lstsq(rows[: len(rows) - k, : j + 10], target[:-k], rcond=None)[0]
    wanted = with_clock - exact
    of_z, of_log_r, told = range_response(at, readings, SIZE)
    assert of_z[:, 0] == pytest.approx(wanted[:d], abs=5e-3 * np.abs(wanted[:d]).max())
    assert of_log_r[:10, 0] == pytest.approx(wanted[j:], abs=5e-3 * np.abs(wanted[j:]).max())
    assert not of_log_r[10].any()
    covariance = np.linalg.inv(rows.T @ rows)
    found = told.spread @ told.spread.T
    assert found == pytest.approx(covariance[j + 10 :, j + 10 :], abs=2e-3)
    none = np.linalg.inv(rows[: len(rows) - k, : j + 10].T @ rows[: len(rows) - k, : j + 10])
    added = np.diag(covariance)[:d] - np.diag(none)[:d]
    size = np.square(of_z[:, 1:]).sum(axis=1)
    assert size == pytest.approx(added, abs=5e-3 * added.max())
    assert (size / np.diag(none)[:d]).max() > 5e-3
