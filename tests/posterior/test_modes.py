"""Modes of a range: separate clusters are told apart, tails of one are not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.modes import range_modes

Array = NDArray[np.float64]


@pytest.mark.parametrize("share", [0.5, 0.9, 0.96])
def test_two_clusters(share: float) -> None:
    rng = np.random.default_rng(100)
    n = 1000
    first = rng.random(n) < share
    draws = np.where(first, 0.7, 0.9) * np.exp(0.005 * rng.standard_normal(n))
    near, far = range_modes(draws)
    assert near.weight == pytest.approx(first.mean(), abs=1e-12)
    assert near.weight + far.weight == pytest.approx(1.0, abs=1e-12)
    assert near.range_m == pytest.approx(float(np.median(draws[first])), rel=1e-12)
    assert far.range_m == pytest.approx(float(np.median(draws[~first])), rel=1e-12)


def test_three_clusters_of_different_widths_by_ascending_range() -> None:
    rng = np.random.default_rng(101)
    parts = [
        r * np.exp(sd * rng.standard_normal(300))
        for r, sd in ((5.0, 1e-3), (0.2, 1e-4), (1.0, 0.05))
    ]
    found = range_modes(rng.permutation(np.concatenate(parts)))
    assert [mode.range_m for mode in found] == pytest.approx([0.2, 1.0, 5.0], rel=0.02)
    assert [mode.weight for mode in found] == pytest.approx([1 / 3] * 3, abs=1e-12)


def laws(rng: np.random.Generator, n: int) -> dict[str, Array]:
    """Samples of log r, each of one mode."""
    return {
        "normal": rng.standard_normal(n),
        "t of three": rng.standard_t(3, n),
        "Cauchy": 0.01 * rng.standard_cauchy(n),
        "exponential": rng.exponential(size=n),
        "Laplace": rng.laplace(size=n),
        "narrow on broad": rng.standard_normal(n) * np.where(rng.random(n) < 0.5, 0.01, 1.0),
        "uniform": rng.random(n),
    }


@pytest.mark.parametrize("n", [40, 200, 1000])
def test_one_mode_is_not_split(n: int) -> None:
    """A gap beats twice the sums of the 19 gaps on either side, were all alike, in less than 3^-19
    of the cases: over 500 samples of 7 laws less than 0.003 are expected."""
    rng = np.random.default_rng(102)
    for _ in range(500):
        for name, draws in laws(rng, n).items():
            assert len(range_modes(np.exp(np.clip(draws, -300, 300)))) == 1, name


def test_few_draws_are_one_mode() -> None:
    assert len(range_modes(np.array([1.0] * 19 + [2.0] * 20))) == 1


def test_repeated_draws_of_one_walker_are_no_mode() -> None:
    rng = np.random.default_rng(103)
    draws = np.repeat(np.exp(0.1 * rng.standard_normal(250)), 4)
    (mode,) = range_modes(draws)
    assert mode.weight == 1.0


def test_a_constant_range_is_one_mode() -> None:
    (mode,) = range_modes(np.full(100, 0.7))
    assert mode.range_m == pytest.approx(0.7, rel=1e-15)
