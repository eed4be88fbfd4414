"""Importance weights: their shape says when they cannot be trusted."""

import math

import numpy as np
import pytest

from inference.posterior.sampling.importance import pareto_k_hat
from inference.posterior.selection.leave_one_out import leave_one_out


def test_one_weight_that_is_all_there_is_cannot_be_trusted() -> None:
    """All others underflow beside it: there is no tail to fit, and not because all are equal."""
    steps = 800.0 * np.arange(1, 2000)
    assert pareto_k_hat(np.append(0.0, -steps)) == np.inf
    assert leave_one_out(np.append(0.0, steps)[:, None]).k_hat[0] == np.inf


def test_equal_weights_are_the_best_there_are() -> None:
    rounding = 1e-12 * np.random.default_rng(0).standard_normal(2000)
    assert pareto_k_hat(np.zeros(2000)) == -np.inf
    assert leave_one_out(np.zeros((2000, 1))).k_hat[0] == -np.inf
    assert pareto_k_hat(rounding) < 0.5
    assert leave_one_out(rounding[:, None]).k_hat[0] < 0.5


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9])
def test_the_shape_of_a_pareto_law_is_found(shape: float) -> None:
    """From the largest 3 sqrt(n) weights: its sd is (1 + k) / sqrt of their number, and a prior
    worth ten draws it towards 0.5; bands of five sd."""
    n = 40_000
    tail = 3 * math.sqrt(n)
    log_weights = -shape * np.log(np.random.default_rng(2).random(n))
    found = pareto_k_hat(log_weights)
    drawn = (tail * shape + 10 * 0.5) / (tail + 10)
    assert found == pytest.approx(drawn, abs=5 * (1 + shape) / math.sqrt(tail))
