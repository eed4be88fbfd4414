"""Importance weights: their shape says when they cannot be trusted."""

import numpy as np

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
