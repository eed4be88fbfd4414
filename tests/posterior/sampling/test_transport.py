"""The triangular map: exactly invertible, its determinant right, curved samples straightened."""

from typing import Any

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inference.posterior.sampling import transport as transport_module
from inference.posterior.sampling.transport import (
    TriangularMap,
    fit_map,
    straight_map,
    unbent_map,
)


def _banana(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw from a curved sheet in four dimensions, thin to a thousandth."""
    x = rng.standard_normal((n, 4))
    z = np.empty_like(x)
    z[:, 0] = 2.0 * x[:, 0]
    z[:, 1] = 0.3 * x[:, 1] * np.exp(0.4 * x[:, 0]) + 0.2 * z[:, 0] ** 2
    z[:, 2] = 1e-3 * x[:, 2] + 0.05 * z[:, 0] * z[:, 1]
    z[:, 3] = 0.1 * x[:, 3] - 0.02 * z[:, 0] ** 3
    return z


@pytest.fixture(scope="module")
def transport() -> TriangularMap:
    return fit_map(_banana(np.random.default_rng(1), 4000))


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.01, 20.0))
def test_inverse(transport: TriangularMap, seed: int, scale: float) -> None:
    """Far beyond the fitted sample as well, where polynomials alone would explode."""
    x = scale * np.random.default_rng(seed).standard_normal((16, 4))
    z, log_det = transport.bend(x)
    assert np.isfinite(z).all()
    back, back_det = transport.unbend(z)
    # a rounding of the widest coordinate is so much of the thinnest scale, over some operations
    lost = 100 * 2.2e-16 * (1 + np.abs(z).max()) / np.exp(transport.scales[:, 0]).min() / 1e-4
    assert back == pytest.approx(x, rel=lost, abs=lost)
    assert back_det == pytest.approx(-log_det, rel=lost, abs=lost)


def test_determinant_against_differences(transport: TriangularMap) -> None:
    rng = np.random.default_rng(2)
    h = 1e-6
    for x in rng.standard_normal((10, 4)):
        steps = np.concatenate([x + h * np.eye(4), x - h * np.eye(4)])
        z = transport.bend(steps)[0]
        jacobian = (z[:4] - z[4:]) / (2 * h)
        expected = np.linalg.slogdet(jacobian)[1]
        # second differences of order one, rounding of 1e-16 / 1e-6 against the thin 1e-3
        assert transport.bend(x[None])[1][0] == pytest.approx(expected, abs=1e-5)


def test_a_curved_sample_becomes_nearly_normal(transport: TriangularMap) -> None:
    """Kolmogorov-Smirnov at 1e-4 for each coordinate: this fit is within its reach."""
    fresh = _banana(np.random.default_rng(3), 500)
    x = transport.unbend(fresh)[0]
    assert np.abs(np.corrcoef(x.T) - np.eye(4)).max() < 4.5 / np.sqrt(500)
    for column in x.T:
        assert stats.kstest(column, "norm").pvalue > 1e-4
    # without the map the sheet is anything but normal
    white = (fresh - fresh.mean(axis=0)) / fresh.std(axis=0)
    assert stats.kstest(white[:, 1], "norm").pvalue < 1e-4


def test_a_flat_sample_has_a_map() -> None:
    """Members that are nearly equal, or few of them distinct, as after resampling."""
    rng = np.random.default_rng(4)
    few = rng.standard_normal((8, 3))[rng.integers(8, size=64)]
    transport = fit_map(few)
    z, log_det = transport.bend(rng.standard_normal((20, 3)))
    assert np.isfinite(z).all()
    assert np.isfinite(log_det).all()


@pytest.mark.parametrize("copies", [1, 3])
def test_draws_that_stand_there_often_count_so_often(copies: int) -> None:
    """Against copies that differ by less than matters, which are rows of their own."""
    rng = np.random.default_rng(6)
    some = _banana(rng, 900)
    often = np.where(np.arange(900) < 300, 2 * copies, copies)
    draws = np.repeat(some, often, axis=0)
    apart = draws + 1e-12 * rng.standard_normal(draws.shape)
    x = rng.standard_normal((40, 4))
    together, alone = fit_map(draws), fit_map(apart)
    np.testing.assert_allclose(together.centre, alone.centre, atol=1e-10)
    np.testing.assert_allclose(together.axes, alone.axes, atol=1e-10)
    if copies == 1:  # terms are judged by how many of the draws are distinct
        assert not np.allclose(together.means, fit_map(some).means, atol=1e-6)
    assert np.isfinite(together.bend(x)[0]).all()


def test_rows_of_a_regression_count_as_often_as_they_stand_there() -> None:
    """Through a parabola: an even line, but where one side counts for more."""
    x = np.linspace(-1.0, 1.0, 200)
    features, times = np.column_stack([np.ones(200), x]), np.where(x > 0, 5.0, 1.0)
    found = transport_module._regression(features, x**2, 1e-9, times)
    root = np.sqrt(times)
    wanted = np.linalg.lstsq(root[:, None] * features, root * x**2)[0]
    assert wanted[1] > 0.2
    # terms are shrunk by their noise, the slope by 12 % here
    np.testing.assert_allclose(found, wanted, rtol=0.2)


def test_draws_of_maps_are_the_same_whatever_signs_singular_vectors_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Planted fault: the same seed drew other points on another processor."""
    sample = _banana(np.random.default_rng(7), 800)
    x = np.random.default_rng(8).standard_normal((20, 4))
    factor = np.linalg.cholesky(np.cov(sample.T))
    svd = scipy.linalg.svd

    def turned(*arguments: Any, **how: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        left, sizes, right = svd(*arguments, **how)
        signs = np.array([1.0, -1.0, -1.0, 1.0])
        return left * signs, sizes, signs[:, None] * right

    def drawn() -> list[np.ndarray]:
        maps = fit_map(sample), straight_map(sample), unbent_map(np.zeros(4), factor, None)
        return [one.bend(x)[0] for one in maps]

    here = drawn()
    monkeypatch.setattr(scipy.linalg, "svd", turned)
    np.testing.assert_allclose(drawn(), here, rtol=1e-9, atol=1e-9)


def test_one_dimension() -> None:
    draws = 3.0 + 0.5 * np.random.default_rng(5).standard_normal((200, 1))
    transport = fit_map(draws)
    x, log_det = transport.unbend(draws)
    assert x.std() == pytest.approx(1.0, rel=1e-9)
    assert log_det == pytest.approx(-np.log(draws.std()), rel=1e-9)


@pytest.mark.parametrize("copies", [1, 2])
def test_a_normal_sample_is_not_bent(copies: int) -> None:
    """What a map of 540 draws loses on draws that it has not seen, nine dimensions [nat].

    A fitted normal law loses 54 parameters / (2 x 540) = 0.05 in the mean. A term of pure noise
    that is held to three squared standard errors keeps 0.057 of its own in the mean: 675 of them
    lose 0.04. Twice that where every draw stands there twice, and as much again where so few
    distinct draws understate the residuals. Polynomials without that test lose 1.2 to 2.2.
    """
    losses = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        seen = np.repeat(rng.standard_normal((540 // copies, 9)), copies, axis=0)
        fresh = rng.standard_normal((4000, 9))
        x, log_det = fit_map(seen).unbend(fresh)
        gaps = 0.5 * np.einsum("ij,ij->i", x, x) - 0.5 * np.einsum("ij,ij->i", fresh, fresh)
        losses.append(float(np.mean(gaps - log_det)))
    assert np.mean(losses) < 0.25 * copies
