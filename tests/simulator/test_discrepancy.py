"""The process of the model's error: its functions, and its size against the optical simulator."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from simulator.discrepancy import DISCREPANCY_SD, SLOPE_SD, discrepancy_basis, matern
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD, ModelError
from simulator.optics.misfit import model_misfit
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, parse_sensor
from simulator.shadow_error import SHADOW_SD
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

DEFAULT = ModelError(DISCREPANCY_SD, RANGE_ERROR_SD, integrated=False, shadow=SHADOW_SD)


@pytest.mark.parametrize("span", [(0.2, 0.4), (0.05, 1.0), (0.02, 20.0)])
def test_the_functions_make_up_the_covariance(span: tuple[float, float]) -> None:
    basis = discrepancy_basis(*span)
    u = np.linspace(math.log(span[0]), math.log(span[1]), 97)
    values = basis.values(u)
    # what is left out is a ten thousandth of the variance on average, more at the ends
    np.testing.assert_allclose(values @ values.T, matern(u[:, None] - u[None, :]), atol=1e-3)
    assert np.mean(1 - np.square(values).sum(axis=1)) == pytest.approx(0.0, abs=2e-4)


def test_slopes_are_derivatives_and_the_functions_constant_outside() -> None:
    basis = discrepancy_basis(0.1, 2.0)
    u = np.linspace(math.log(0.1) + 0.01, math.log(2.0) - 0.01, 50) + 1e-3
    h = 1e-6
    difference = (basis.values(u + h) - basis.values(u - h)) / (2 * h)
    # second derivatives jump at knots, by the error of the cubics there
    np.testing.assert_allclose(basis.slopes(u), difference, atol=1e-3)
    outside = np.array([math.log(0.1) - 3.0, math.log(2.0) + 1.0])
    ends = np.array([math.log(0.1), math.log(2.0)])
    np.testing.assert_allclose(basis.values(outside), basis.values(ends), rtol=1e-12)
    assert not basis.slopes(outside).any()


def test_sums_of_the_functions_are_those_of_their_values() -> None:
    """Also outside, where they are constant; sums of 10 to 30 terms are rounded a few times."""
    basis, rng = discrepancy_basis(0.1, 2.0), np.random.default_rng(4)
    u = rng.uniform(math.log(0.05), math.log(3.0), (7, 20))
    coefficients = rng.standard_normal((7, basis.size))
    wanted = np.einsum("nmk,nk->nm", basis.values(u), coefficients)
    np.testing.assert_allclose(basis.sums(u, coefficients), wanted, rtol=0, atol=1e-13)


def test_the_slope_has_the_stated_size() -> None:
    """-C''(0), by a difference of a series whose next term is 25 h^2 / 24 of the whole."""
    h = 1e-4
    bend = 2.0 * (1.0 - float(matern(np.array(h)))) / h**2
    assert pytest.approx(bend, rel=1e-6) == SLOPE_SD**2
    basis = discrepancy_basis(0.1, 2.0)
    inside = np.linspace(math.log(0.2), math.log(1.0), 40)
    # functions that are left out have next to no size, but are steep: a few hundredths of the slope
    drawn = np.square(basis.slopes(inside)).sum(axis=1)
    assert np.sqrt(drawn).mean() == pytest.approx(SLOPE_SD, rel=0.03)


def test_a_prior_without_a_lower_end_has_a_basis() -> None:
    basis = discrepancy_basis(0.0, 5.0)
    assert np.isfinite(basis.knots).all()
    assert basis.first == pytest.approx(math.log(5.0) - 8.0)


def _left_by_a_fit(u: Array, covariance: Array, c0: float) -> Array:
    """Covariance of what a least squares fit of log flux in c0, c1 and c2 leaves."""
    r = np.exp(u)
    quadratic = r**2 + c0
    directions = np.column_stack([np.ones_like(r), 1 / quadratic, r / quadratic])
    q = np.linalg.qr(directions)[0]
    rest = np.eye(u.size) - q @ q.T
    return np.asarray(rest @ covariance @ rest)


def test_size_and_length_are_those_of_the_optical_simulators_misfit() -> None:
    """A path, fitted by the model on 0.01 to 1 m, leaves what plates of Appendix B leave."""
    u = np.log(np.geomspace(0.01, 1.0, 40))
    covariance = DISCREPANCY_SD**2 * matern(u[:, None] - u[None, :])
    left = np.mean(
        [_left_by_a_fit(u, covariance, c0) for c0 in np.geomspace(0.005, 1.5, 12)], axis=0
    )
    measured = model_misfit()["all"]
    assert math.sqrt(np.mean(np.diag(left))) == pytest.approx(measured.rms, rel=0.02)
    correlation = np.array([np.mean(np.diag(left, lag)) for lag in range(15)])
    lags = (u[1] - u[0]) * np.arange(15)
    length = np.interp(-math.exp(-0.5), -correlation / correlation[0], lags)
    # the longest paths leave 0.37: the table cannot tell lengths above one apart
    assert length == pytest.approx(measured.correlation_length, rel=0.2)


def test_share_that_a_calibration_leaves() -> None:
    """A path of unit size, fitted on 0.1 to 2.4 m."""
    u = np.log(np.geomspace(0.1, 2.4, 40))
    covariance = matern(u[:, None] - u[None, :])
    left = [_left_by_a_fit(u, covariance, c0) for c0 in np.geomspace(0.005, 1.5, 12)]
    share = math.sqrt(np.mean([np.diag(each) for each in left]))
    assert share == pytest.approx(FITTED_SHARE, rel=0.01)


@pytest.mark.parametrize(
    ("scene", "meant"),
    [
        ({}, DEFAULT),
        ({"discrepancy": "default"}, DEFAULT),
        ({"discrepancy": 0}, ModelError(0.0, 0.0, integrated=False)),
        ({"discrepancy": 0.05}, ModelError(0.05, 0.0, integrated=True)),
        ({"discrepancy": {"range_m": 0.001}}, ModelError(0.0, 0.001, integrated=True)),
        (
            {"discrepancy": {"flux": 0.1, "shadow": 0.3}},
            ModelError(0.1, 0.0, integrated=True, shadow=0.3),
        ),
        ({"discrepancy": {"shadow": 0.3}}, ModelError(0.0, 0.0, integrated=False, shadow=0.3)),
        ({"discrepancy": {"flux": 0, "range_m": 0}}, ModelError(0.0, 0.0, integrated=False)),
    ],
    ids=str,
)
def test_what_a_scene_says_of_the_error_of_the_model(
    scene: dict[str, Any], meant: ModelError
) -> None:
    parsed = parse_scene(scene)
    assert parsed.model_error == meant
    assert Scene.model_validate_json(parsed.model_dump_json()) == parsed


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_the_stated_error_of_the_range_moves_the_time_of_flight_alone(kind: str) -> None:
    """Readings of 100 scenes over eight lengths of the error: worth 800 independent ones."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-15, 1e-15]}}
        if kind == "pulsed"
        else {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-15, 1e-15]}}
    )
    known = {"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}}
    scene = parse_scene(known | {"discrepancy": {"range_m": 0.002}})
    ranges = np.geomspace(0.004, 12.0, 33)
    path = SampledTrajectory(range_m=ranges.tolist())
    exact = simulate(sensor, parse_scene(known), path, 0).frames.readings
    rng = np.random.default_rng(5)
    read = np.array([simulate(sensor, scene, path, rng).frames.readings for _ in range(100)])
    if isinstance(sensor, PulsedSensor):
        strength, late = read[..., 1], sensor.r0 * read[..., 0] / read[..., 1]
        whole = exact[:, 1]
    else:
        strength, late = np.hypot(*read.T).T, np.arctan2(*read.T[::-1]).T / sensor.wave_number
        whole = np.hypot(*exact.T)
    assert strength == pytest.approx(np.broadcast_to(whole, strength.shape), rel=1e-9)
    error = late - ranges
    # five standard errors: one false alarm in a million
    assert error.std() == pytest.approx(0.002, rel=5 / math.sqrt(1600))
    lag = math.log(ranges[1] / ranges[0])
    together = float(matern(np.array(4 * lag)))
    found = np.corrcoef(error[:, :-4].ravel(), error[:, 4:].ravel())[0, 1]
    assert found == pytest.approx(together, abs=5 * (1 - together**2) / math.sqrt(800))
