"""Least squares for object and shadow parameters."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.optics.closed_forms import disk_distance, disk_flux, disk_shadow
from simulator.optics.misfit import Misfit, measure, misfit_curve, model_misfit
from simulator.optics.parametrisation import (
    Weights,
    fit_object,
    fit_shadow,
)

Array = NDArray[np.float64]

RANGES: Array = np.logspace(-1, 0.3, 40)


def _flux(c0: float, c1: float, c2: float, r: Array = RANGES) -> Array:
    return np.asarray(c0 * c2 / (r * r * (r * r + c1 * r + c0)))


@settings(deadline=None, max_examples=60)
@given(
    st.floats(-3, 1), st.floats(-0.9, 3.0), st.floats(-3, 0), st.sampled_from([1e-12, 1.0, 1e12])
)
def test_exact_data_are_recovered(log_c0: float, shape: float, log_c2: float, unit: float) -> None:
    c0, c2 = 10**log_c0, 10**log_c2
    c1 = 2 * math.sqrt(c0) * shape
    fit = fit_object(RANGES, unit * _flux(c0, c1, c2))
    # condition: c0 enters as r^2/c0 of the whole, at most (2^2)/0.001 and at least 4/10 here
    assert fit.c0 == pytest.approx(c0, rel=1e-9)
    assert fit.c1 == pytest.approx(c1, rel=1e-8, abs=1e-9)
    assert fit.c2 == pytest.approx(unit * c2, rel=1e-9)
    assert fit.error < 1e-20


def test_unit_of_length_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    flux = _flux(0.1, -0.1, 0.1) * (1 + 0.01 * rng.standard_normal(40))
    one, other = fit_object(RANGES, flux), fit_object(RANGES * 1e6, flux / 1e12)
    assert other.c0 == pytest.approx(one.c0 * 1e12, rel=1e-10)
    assert other.c1 == pytest.approx(one.c1 * 1e6, rel=1e-10)
    assert other.sd_c0 == pytest.approx(one.sd_c0 * 1e12, rel=1e-9)


@pytest.mark.parametrize("weights", ["proportional", "additive"])
def test_standard_errors_are_the_spread(weights: Weights) -> None:
    """400 repetitions: the spread of an estimate is known to 3.5 %; 4 sigma is 14 %.

    False-alarm rate of the six comparisons below 1e-3.
    """
    rng = np.random.default_rng(7)
    truth = _flux(0.1, 0.05, 0.1)
    found, claimed = [], []
    for _ in range(400):
        size = 1e-3 * truth if weights == "proportional" else 1e-4
        fit = fit_object(RANGES, truth + size * rng.standard_normal(40), weights)
        found.append((fit.c0, fit.c1, fit.c2))
        claimed.append((fit.sd_c0, fit.sd_c1, fit.sd_c2))
    spread, stated = np.std(found, axis=0), np.mean(claimed, axis=0)
    assert stated == pytest.approx(spread, rel=0.15)
    assert np.mean(found, axis=0) == pytest.approx([0.1, 0.05, 0.1], rel=0.02)


def test_weights_of_additive_noise() -> None:
    """docs/model.md, 5.7: dividing by b^2 is an order of magnitude better for additive noise."""
    rng = np.random.default_rng(3)
    truth = _flux(0.1, 0.05, 0.1)
    errors: dict[str, list[float]] = {"proportional": [], "additive": []}
    for _ in range(50):
        noisy = np.maximum(truth + 1e-4 * rng.standard_normal(40), 1e-6)
        for name in ("proportional", "additive"):
            weights: Weights = "additive" if name == "additive" else "proportional"
            errors[name].append(fit_object(RANGES, noisy, weights).c2 / 0.1 - 1)
    assert np.std(errors["additive"]) < 0.2 * np.std(errors["proportional"])


def test_square_law_is_called_by_its_name() -> None:
    fit = fit_object(RANGES, 0.1 / RANGES**2)
    assert fit.identifiable == (False, False, True)
    assert "square law" in fit.statement
    assert fit.c2 == pytest.approx(0.1)
    assert math.isinf(fit.sd_c0)
    rng = np.random.default_rng(2)
    noisy = fit_object(RANGES, 0.1 / RANGES**2 * (1 + 1e-3 * rng.standard_normal(40)))
    assert noisy.identifiable == (False, False, True)


def test_fourth_law_is_called_by_its_name() -> None:
    fit = fit_object(RANGES, 0.1 / RANGES**4)
    assert not fit.identifiable[0]
    assert "fourth law" in fit.statement


@pytest.mark.parametrize(
    ("ranges", "flux", "pointer"),
    [
        ([0.1, 0.2], [1.0, 2.0], "/range_m"),
        ([0.1, 0.2, 0.2], [1.0, 2.0, 2.0], "/range_m"),
        ([0.1, 0.2, math.nan], [1.0, 2.0, 3.0], "/range_m"),
        ([0.1, 0.2, 0.3], [1.0, 2.0, 0.0], "/flux"),
        ([0.1, 0.2, 0.3], [1.0, 2.0], "/flux"),
        ([0.1, 0.2, 0.3], [1.0, 2.0, math.inf], "/flux"),
    ],
)
def test_bad_data(ranges: list[float], flux: list[float], pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        fit_object(np.array(ranges), np.array(flux))
    assert pointer in [problem.pointer for problem in caught.value.problems]


def test_three_points_leave_no_standard_error() -> None:
    fit = fit_object(RANGES[:3], _flux(0.1, 0.1, 0.1)[:3])
    assert fit.c0 == pytest.approx(0.1, rel=1e-6)
    assert math.isnan(fit.sd_c0)


def test_shadow_of_a_disk() -> None:
    """docs/model.md, 3.30: the best fit in r_e is c0' = 1.14 a^2, c1' = -0.11 a."""
    z = np.logspace(-2, 2, 200)
    r = np.array([disk_distance(float(x), 1.0) for x in z])
    visible = np.array([disk_shadow(float(x), 1.0) for x in z])
    fit = fit_shadow(r, visible)
    assert fit.c0 == pytest.approx(1.14, abs=0.15)
    assert fit.c1 == pytest.approx(-0.11, abs=0.15)
    exact = fit_shadow(z, visible)  # in z it is exact: S = z^2/(z^2 + a^2)
    assert exact.c0 == pytest.approx(1.0)
    assert exact.c1 == pytest.approx(0.0, abs=1e-12)


def test_shadow_parameters_are_recovered() -> None:
    c0, c1 = 0.06, 0.02
    visible = (RANGES**2 + c1 * RANGES) / (RANGES**2 + c1 * RANGES + c0)
    fit = fit_shadow(RANGES, visible)
    assert (fit.c0, fit.c1) == pytest.approx((c0, c1), rel=1e-9)
    with pytest.raises(InvalidInputError, match="/visible"):
        fit_shadow(RANGES, np.ones(40))


def test_disk_object_parameters_of_the_model() -> None:
    """docs/model.md, object: a disk has c1 = -0.41 a to -0.47 a, c0 about 1.6 a^2."""
    z = np.logspace(-2, 2, 200)
    r = np.array([disk_distance(float(x), 1.0) for x in z])
    fit = fit_object(r, np.array([disk_flux(float(x), 1.0) for x in z]))
    assert fit.c0 == pytest.approx(1.6, rel=0.05)
    assert -0.5 < fit.c1 < -0.38


@pytest.mark.slow
def test_committed_misfit_table_is_what_the_code_measures() -> None:
    table = model_misfit()
    measured = {row.scene_class: row for row in measure()}
    assert table.keys() == measured.keys()
    for name, row in table.items():
        for field in ("rms", "mean_absolute", "worst", "correlation_length", "extrapolated"):
            # four digits are committed
            assert getattr(row, field) == pytest.approx(getattr(measured[name], field), rel=1e-3)


def test_the_misfit_is_one_to_several_percent() -> None:
    """docs/model.md, appendix-b: 1.6 % on average, 7.7 % rms of the worst scene."""
    every: Misfit = model_misfit()["all"]
    assert 0.01 < every.mean_absolute < 0.03
    assert every.rms > every.mean_absolute
    assert 0.2 < every.correlation_length < 1.0
    curve = misfit_curve(RANGES, _flux(0.1, 0.1, 0.1))
    assert curve == pytest.approx(np.zeros(40), abs=1e-12)
