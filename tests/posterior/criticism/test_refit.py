"""Which frames a fit cannot be made with, against least squares without each of them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.criticism.refit import Refit

Array = NDArray[np.float64]

LIMIT = 16.0  # of 23 squared normal numbers the largest is above it in 0.1 %


def refit(off: dict[int, float], seed: int = 3) -> Refit:
    """20 frames of one row each, three of two, that bend with four unknowns; some are far off."""
    rng = np.random.default_rng(seed)
    frame = np.append(np.arange(20), np.repeat([20, 21, 22], 2))
    at = np.linspace(-1.0, 1.0, frame.size)
    rows = 30.0 * np.stack([np.ones_like(at), at, at**2, at**3], axis=1)
    before = rng.standard_normal(frame.size)
    for k, size in off.items():
        before[frame == k] += size
    return Refit(before, rows, frame, np.zeros(23))


def chi_square(of: Refit, out: list[int]) -> float:
    """Least squares with the priors as rows, the frames that are left out without weight."""
    kept = ~np.isin(of.frame, out)
    whole = np.concatenate([of.rows[kept], np.eye(4)])
    seen = np.concatenate([of.before[kept], np.zeros(4)])
    return float(np.linalg.lstsq(whole, seen, rcond=None)[1][0])


@pytest.mark.parametrize("off", [{0: 60.0}, {9: -40.0}, {21: 50.0}, {1: 80.0, 9: 60.0, 17: -30.0}])
def test_those_far_off_are_named_and_no_others(off: dict[int, float]) -> None:
    """A frame at the end bends the fit most: its neighbours are far off it, too."""
    found = refit(off).outlying(LIMIT)
    assert found.tolist() == sorted(off)
    if len(off) == 1:
        of = refit(off)
        falls = [chi_square(of, []) - chi_square(of, [k]) for k in range(23)]
        assert found.tolist() == [int(np.argmax(falls))]


def test_a_frame_that_the_fit_follows_is_named_by_what_it_does_to_others() -> None:
    """Of its own residual it keeps next to nothing; others lie farther off."""
    of = refit({})
    rows, before = of.rows.copy(), of.before.copy()
    rows[0] *= 3.0
    before[0] += 200.0
    bent = Refit(before, rows, of.frame, of.beside)
    basis = np.linalg.qr(np.concatenate([rows, np.eye(4)]))[0][: len(rows)]
    left = np.square(before - basis @ (basis.T @ before))
    assert left[0] < 0.5 * left.max()
    assert left.max() > LIMIT
    assert bent.outlying(LIMIT).tolist() == [0]


def test_nothing_is_named_where_nothing_is_far_off() -> None:
    assert refit({}).outlying(LIMIT).size == 0


def test_what_no_unknown_follows_counts() -> None:
    of = refit({})
    beside = np.zeros(23)
    beside[4] = 100.0
    assert Refit(of.before, of.rows, of.frame, beside).outlying(LIMIT).tolist() == [4]


def test_where_too_many_would_go_all_that_are_off_at_first_are_named() -> None:
    of = refit({k: 300.0 * (-1.0) ** k for k in range(16)})
    found = of.outlying(LIMIT)
    assert found.size > 11
    assert np.array_equal(found, np.unique(found))
