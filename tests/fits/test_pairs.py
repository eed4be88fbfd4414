"""Systems of two equations and triangles of many rows, against what libraries find one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inference.fits.likelihood.pairs import cholesky, solved, solved_by_root
from inference.fits.likelihood.triangle import triangle_of

EPS = np.finfo(float).eps
SEEDS = st.integers(0, 2**32 - 1)


def backward_error(matrices: np.ndarray, found: np.ndarray, parts: np.ndarray) -> float:
    """Largest residual of an equation beside its terms: a few roundings, however near singular."""
    terms = np.abs(matrices) @ np.abs(found) + np.abs(parts)
    return float((np.abs(matrices @ found - parts) / terms.max(axis=1, keepdims=True)).max())


@given(SEEDS)
def test_systems_are_solved_to_rounding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # rows of any size, and determinants down to nearly nothing
    matrices = rng.normal(size=(50, 2, 2)) * 10.0 ** rng.uniform(-8, 8, (50, 1, 1))
    near = rng.random(50) < 0.3
    matrices[near, 1] = matrices[near, 0] * (1 + 1e-6 * rng.normal(size=(near.sum(), 2)))
    parts = rng.normal(size=(50, 2, 3))
    assert backward_error(matrices, solved(matrices, parts), parts) < 20 * EPS
    roots = np.tril(matrices)
    assert backward_error(roots, solved_by_root(roots, parts), parts) < 4 * EPS


@given(SEEDS)
def test_a_small_pivot_is_no_pivot(seed: int) -> None:
    """Without pivoting a first entry of 1e-20 loses the second equation."""
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(20, 2, 2))
    matrices[:, 0, 0] = 1e-20
    parts = rng.normal(size=(20, 2, 1))
    assert backward_error(matrices, solved(matrices, parts), parts) < 20 * EPS


@given(SEEDS)
def test_roots_are_those_of_the_library(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(50, 2, 3)) * 10.0 ** rng.uniform(-3, 3, (50, 1, 1))
    matrices = np.eye(2) + columns @ columns.transpose(0, 2, 1)
    found, right = cholesky(matrices), np.linalg.cholesky(matrices)
    assert found == pytest.approx(right, rel=8 * EPS * np.linalg.cond(matrices).max())
    off = np.abs(found @ found.transpose(0, 2, 1) - matrices).max(axis=(1, 2))
    assert (off <= 8 * EPS * np.abs(matrices).max(axis=(1, 2))).all()


def test_what_is_not_finite_comes_out_again() -> None:
    """Without a warning, and in its own frame alone."""
    parts = np.ones((3, 2, 1))
    parts[0], parts[1] = np.nan, np.inf
    roots = np.broadcast_to(np.array([[2.0, 0.0], [1.0, 1.0]]), (3, 2, 2))
    for solve in (solved, solved_by_root):
        found = solve(roots, parts)
        assert not np.isfinite(found[:2]).any()
        assert found[2, :, 0].tolist() == [0.5, 0.5]


@pytest.mark.parametrize("rows", [3, 60, 700])
@pytest.mark.parametrize("seldom", [0, 9, 30])
def test_triangle_is_that_of_the_library(rows: int, seldom: int) -> None:
    """Up to the signs of its rows; errors that a few rows share stand between the others."""
    rng = np.random.default_rng(rows + seldom)
    matrix = rng.normal(size=(rows, 12 + seldom))
    for column in range(4, 4 + seldom):
        few = rng.choice(rows, 3, replace=False)
        kept = matrix[few, column]
        matrix[:, column] = 0.0
        matrix[few, column] = kept
    whole = np.concatenate([matrix, np.eye(12 + seldom)])
    found, right = triangle_of(whole), np.linalg.qr(whole, mode="r")
    scale = np.linalg.norm(whole)
    assert np.abs(np.abs(found) - np.abs(right)).max() < 50 * EPS * scale
    assert np.array_equal(found, np.triu(found))


def test_rows_that_all_are_shared_by_few_are_reduced_too() -> None:
    matrix = np.asarray(np.kron(np.eye(8), np.ones((100, 1))), np.float64)
    assert np.abs(triangle_of(matrix)) == pytest.approx(10.0 * np.eye(8))
