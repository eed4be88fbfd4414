"""Bounds on intervals beside errors of the model that all frames share."""

import dataclasses

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from benchmarks.recorded_bounds import Truth, beyond, demanded, fitted_object, widths
from simulator.discrepancy import DISCREPANCY_SD, discrepancy_basis
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import _moments, simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

_NOISE = 1e-6
_SENSOR = parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [_NOISE, _NOISE]}}
)
_OBJECT = {"c0": 0.1, "c1": 0.02, "c2": 0.1}
_CROSSTALK = [0.001, 0.005]
_RANGE = np.geomspace(0.2, 1.2, 10)
_RULER_M = 5e-4
_TRUTH = Truth(
    _SENSOR,
    {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.05}] * 2},
    _RANGE,
    {f"object.{name}": value for name, value in _OBJECT.items()}
    | {"crosstalk.w1": _CROSSTALK[0], "crosstalk.w2": _CROSSTALK[1]},
)


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_how_large_errors_were_is_told_where_ranges_are_known(times: float) -> None:
    sizes = {"flux": times * DISCREPANCY_SD, "range_m": times * RANGE_ERROR_SD}
    scene = parse_scene({"object": _OBJECT, "crosstalk": _CROSSTALK, "discrepancy": sizes})
    path = SampledTrajectory(range_m=_RANGE.tolist())
    found = [demanded(_TRUTH, simulate(_SENSOR, scene, path, n).frames) for n in range(4)]
    # some 24 coefficients are told: chi-square of as many, 1e-4 on either side
    low, high = np.sqrt(scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], 24) / 24)
    assert low < np.sqrt(np.mean(np.square(found))) / times < high


def test_ranges_are_missed_by_what_is_left_open() -> None:
    """Errors of the model and noise are drawn anew; what the priors pull is less than these."""
    sizes = {"flux": DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}
    scene = parse_scene({"object": _OBJECT, "crosstalk": _CROSSTALK, "discrepancy": sizes})
    path = SampledTrajectory(range_m=_RANGE.tolist())
    known = np.where(np.isin(np.arange(_RANGE.size), (0, 9)), _RANGE, np.nan)
    told = {"known_range_m": known, "known_range_sd_m": np.full(_RANGE.size, _RULER_M)}
    middle = []
    for seed in range(60):
        frames = simulate(_SENSOR, scene, path, seed).frames
        middle.append(beyond(_TRUTH, dataclasses.replace(frames, **told))[5])
    # 60 squares of a normal law, 1e-4 on either side
    low, high = (float(scipy.stats.chi2.ppf(p, 60)) / 60 for p in (1e-4, 1 - 1e-4))
    assert low < np.mean(np.square(middle)) < high


def test_bounds_are_those_of_all_unknowns_at_once() -> None:
    """Readings along everything by differences, and one inverse, where two ranges are known."""
    sd = np.full(_RANGE.size, _RULER_M)
    known = np.where(np.isin(np.arange(_RANGE.size), (0, 9)), _RANGE, np.nan)
    frames = Frames(np.zeros((_RANGE.size, 2)), known_range_m=known, known_range_sd_m=sd)
    parameters = parameters_of(_SENSOR, parse_scene(_TRUTH.scene))
    basis = discrepancy_basis(*parameters.reach_m)
    values = parameters.natural(np.zeros((1, len(parameters))))
    for j, name in enumerate(parameters.names):
        values[0, j] = _TRUTH.at[name]
    d, k, n = len(parameters), basis.size, _RANGE.size
    start = np.concatenate([parameters.standard(values)[0], np.zeros(2 * k), np.log(_RANGE)])

    def rows(x: Array) -> Array:
        log_r = x[d + 2 * k :]
        shapes = basis.values(log_r)
        factor = np.exp(DISCREPANCY_SD * shapes @ x[d : d + k])
        late = RANGE_ERROR_SD * shapes @ x[d + k : d + 2 * k]
        terms = parameters.terms(x[None, :d])
        readings = _moments(_SENSOR, terms, np.exp(log_r), factor, late)[:, :2] / _NOISE
        told = np.exp(log_r[[0, 9]]) / _RULER_M
        return np.concatenate([readings.ravel(), told, x[: d + 2 * k]])

    steps = 1e-5 * np.eye(start.size)
    jacobian = np.array([rows(start + s) - rows(start - s) for s in steps]).T / 2e-5
    triangle = scipy.linalg.qr(jacobian, mode="r")[0][: start.size]
    inverse = scipy.linalg.solve_triangular(triangle, np.eye(start.size))
    expected = 2.0 * 1.6448536 * np.linalg.norm(inverse[-n:], axis=1)
    np.testing.assert_allclose(widths(_TRUTH, frames), expected, rtol=1e-2)
    nothing = dataclasses.replace(frames, known_range_m=None, known_range_sd_m=None)
    assert (widths(_TRUTH, nothing) > expected).all()


def test_an_object_as_the_model_is_found() -> None:
    c0, c1, c2 = _OBJECT.values()
    light = c0 * c2 / (_RANGE**2 * (_RANGE**2 + c1 * _RANGE + c0))
    found = fitted_object(light, _RANGE)
    assert found == pytest.approx({f"object.{name}": at for name, at in _OBJECT.items()}, rel=1e-6)
