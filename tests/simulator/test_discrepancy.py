"""The process of the model's error: its functions, and its size against the optical simulator."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from simulator.discrepancy import DISCREPANCY_SD, discrepancy_basis, matern
from simulator.optics.misfit import model_misfit
from simulator.scene import parse_scene

Array = NDArray[np.float64]


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


def test_a_scene_may_ask_for_the_measured_size() -> None:
    assert parse_scene({"discrepancy": "default"}).discrepancy == DISCREPANCY_SD
    assert parse_scene({}).discrepancy is None
