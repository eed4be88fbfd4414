"""Modes of a quantity: separate clusters are told apart, tails of one are not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.answer.separation import boundaries, labels

Array = NDArray[np.float64]


@pytest.mark.parametrize("share", [0.5, 0.9, 0.98])
def test_two_clusters(share: float) -> None:
    rng = np.random.default_rng(100)
    n = 1000
    first = rng.random(n) < share
    draws = np.where(first, 0.7, 0.9) * np.exp(0.005 * rng.standard_normal(n))
    cuts = boundaries(np.log(draws))
    assert cuts.size == 1
    assert np.array_equal(labels(np.log(draws), cuts) == 0, first)


def test_three_clusters_of_different_widths_by_ascending_value() -> None:
    rng = np.random.default_rng(101)
    places, widths = np.log([5.0, 0.2, 1.0]), (1e-3, 1e-4, 0.05)
    parts = [
        place + sd * rng.standard_normal(300) for place, sd in zip(places, widths, strict=True)
    ]
    cuts = boundaries(rng.permutation(np.concatenate(parts)))
    assert labels(places, cuts).tolist() == [2, 0, 1]
    assert [np.unique(labels(part, cuts)).tolist() for part in parts] == [[2], [0], [1]]


def test_the_unit_does_not_matter() -> None:
    rng = np.random.default_rng(104)
    draws = np.concatenate([rng.standard_normal(200), 30 + rng.standard_normal(100)])
    cuts = boundaries(draws)
    assert boundaries(2.0**-40 * draws + 0.0) == pytest.approx(2.0**-40 * cuts, rel=1e-12)


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
    """A gap beats twice the sum of the 19 gaps beside it, were all alike, in 3^-19 of the cases,
    and eight times that of 9 in 9^-9: over 500 samples of 7 laws 0.013 are expected."""
    rng = np.random.default_rng(102)
    for _ in range(500):
        for name, draws in laws(rng, n).items():
            assert boundaries(draws).size == 0, name


def test_few_draws_are_one_mode() -> None:
    rng = np.random.default_rng(105)
    few = rng.standard_normal(9)
    assert boundaries(np.concatenate([few, 1e6 + rng.standard_normal(9)])).size == 0
    assert boundaries(few[:0]).size == 0


def test_a_walker_that_does_not_move_is_no_mode() -> None:
    rng = np.random.default_rng(103)
    draws = rng.standard_normal(250)
    assert boundaries(np.repeat(draws, 40)).size == 0
    assert boundaries(np.concatenate([draws, np.full(1000, 9.0)])).size == 0


def test_a_constant_is_one_mode() -> None:
    assert boundaries(np.full(100, 0.7)).size == 0
