"""Effective sizes of walkers that began at draws of the posterior, and walked a few steps."""

import math

import numpy as np
import pytest

from inference.posterior.answer.shares import share_error
from inference.posterior.sampling.diagnostics import effective_sample_size

WALKERS, STEPS, RUNS = 256, 20, 400


def _walk(rng: np.random.Generator, memory: float, pool: int) -> np.ndarray:
    """Walk from draws that were drawn again from a pool of so many: shape (4, 64, steps)."""
    _, which = np.unique(rng.integers(pool, size=WALKERS), return_inverse=True)
    x = rng.standard_normal(which.max() + 1)[which]  # of the pool those that are drawn at all
    steps = []
    for _ in range(STEPS):
        x = memory * x + math.sqrt(1.0 - memory**2) * rng.standard_normal(WALKERS)
        steps.append(x)
    return np.array(steps).T.reshape(4, 64, STEPS)


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9, 0.99, 0.9999])
@pytest.mark.parametrize("pool", [300, 1_000_000])
def test_means_err_as_the_size_says(memory: float, pool: int) -> None:
    """However long walkers stay: autocorrelation of the ensembles' means says 0.4 to 10 times as
    much. The mean of 400 squares has a standard error of 0.07: bands of 4.5 of them, a false alarm
    once in 1e5 of each of ten."""
    rng = np.random.default_rng(7)
    squares, sizes = [], []
    for _ in range(RUNS):
        draws = _walk(rng, memory, pool)
        size = effective_sample_size(draws, float(pool))
        squares.append((draws.mean() / draws.std()) ** 2 * size)
        sizes.append(size)
    assert abs(np.mean(squares) - 1.0) < 4.5 * math.sqrt(2.0 / RUNS)
    if memory == 0.9999:  # next to none has moved
        assert np.mean(sizes) == pytest.approx(1.0 / (1 / WALKERS + 1 / pool), rel=0.02)


def test_a_constant_has_none() -> None:
    assert math.isnan(effective_sample_size(np.ones((4, 64, 20)), 400.0))


@pytest.mark.parametrize("memory", [0.0, 0.999])
def test_a_share_errs_as_is_said(memory: float) -> None:
    """Bands as above; a share that no walker came into has no error to be told."""
    rng, squares = np.random.default_rng(8), []
    for _ in range(RUNS):
        inside = _walk(rng, memory, 1_000_000) > 1.0
        error = share_error(inside, 1e6)
        assert error is not None
        squares.append(((inside.mean() - 0.15865525) / error) ** 2)
    assert abs(np.mean(squares) - 1.0) < 4.5 * math.sqrt(2.0 / RUNS)
    assert share_error(np.zeros((4, 64, 20), dtype=bool), 400.0) is None
