"""Importance weights: their shape says when they cannot be trusted."""

import math

import numpy as np
import pytest

from inference.posterior.sampling.importance import (
    log_ratio,
    pareto_k_hat,
    weighted_by,
    weighted_sizes,
)
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


def test_smoothed_weights_of_no_variance_err_half_as_much() -> None:
    """Pareto weights of shape 0.65, whose mean is known: it errs by 0.17 and 0.07."""
    k, n, replicates = 0.65, 2000, 300
    error, size = np.empty((2, replicates)), np.empty((2, replicates))
    for seed in range(replicates):
        u = np.random.default_rng(seed).random(n)
        for i, smooth in enumerate((False, True)):
            draws = weighted_by(u[:, None], -k * np.log(u), np.zeros(n), smooth=smooth)
            error[i, seed], size[i, seed] = draws.log_evidence + np.log1p(-k), draws.ess
            assert draws.weights.sum() == pytest.approx(1.0, abs=1e-12)
    rms = np.sqrt(np.mean(error**2, axis=1))
    # an rms over 300 replicates is known to 4 %, more where tails are heavy
    assert rms[1] < 0.6 * rms[0]
    # the relative variance of the weights is n / ess - 1; of the weights' own mean that is not all
    assert rms[1] < 2.0 * np.sqrt(np.median(1.0 / size[1] - 1.0 / n))


def test_effective_sizes_say_how_far_estimates_spread() -> None:
    """Of a normal law by draws of one 0.85 times as wide: 600 means, and shares below -1.645.

    Their mean squares by the stated sizes are 1 up to 0.058; bands of five sd. The importance
    sample size, 1,850 of 2,000 draws, says 1.4 of the mean and 1.9 of the share."""
    rng, replicates, cut = np.random.default_rng(6), 600, -1.6448536269514722
    squares = np.empty((replicates, 2))
    for k in range(replicates):
        z = 0.85 * rng.standard_normal(2000)
        draws = weighted_by(z[:, None], -0.5 * z**2, -0.5 * (z / 0.85) ** 2 - np.log(0.85))
        bulk, tail = weighted_sizes(z, draws.weights)
        # the law and the weights are even in z: so are both sizes
        assert weighted_sizes(-z, draws.weights) == pytest.approx((bulk, tail), rel=0.02)
        assert draws.worth == pytest.approx(min(draws.ess, 2.0 * bulk), rel=1e-12)
        mean, below = float(draws.weights @ z), float(draws.weights[z <= cut].sum())
        squares[k] = mean**2 * bulk, (below - 0.05) ** 2 / (0.05 * 0.95) * tail
    assert squares.mean(axis=0) == pytest.approx([1.0, 1.0], abs=5 * 0.058)


def test_equal_weights_are_worth_as_many_draws_as_there_are() -> None:
    x = np.random.default_rng(7).standard_normal(500)
    for each in (x, 1e200 * x, np.zeros(500)):
        assert weighted_sizes(each, np.full(500, 1 / 500)) == pytest.approx((500.0, 500.0))


def test_smoothing_leaves_all_but_the_tail_and_its_order() -> None:
    log_weights = np.random.default_rng(3).standard_normal(4000)
    plain = weighted_by(np.zeros((4000, 1)), log_weights, np.zeros(4000))
    smooth = weighted_by(np.zeros((4000, 1)), log_weights, np.zeros(4000), smooth=True)
    assert smooth.k_hat == plain.k_hat
    order = np.argsort(log_weights)
    tail = int(3 * math.sqrt(4000))
    kept = np.log(smooth.weights / plain.weights)[order[:-tail]]
    assert np.ptp(kept) < 1e-9
    assert (np.diff(smooth.weights[order]) >= 0).all()
    assert smooth.weights.max() <= np.exp(kept[0]) * plain.weights.max() * (1 + 1e-9)


@pytest.mark.parametrize("far", [-np.inf, np.nan])
@pytest.mark.parametrize("smooth", [False, True])
def test_draws_so_far_out_that_no_law_is_a_number_have_no_weight(far: float, smooth: bool) -> None:
    """Planted fault: one of them in a run of rounds made all weights none."""
    rng = np.random.default_rng(3)
    z = rng.standard_normal((2000, 1))
    density, law = -0.6 * z[:, 0] ** 2, -0.5 * z[:, 0] ** 2
    density[:40] = -np.inf
    beyond = np.where(np.arange(2000) < 20, far, law)
    assert (log_ratio(density, beyond) == log_ratio(density, law)).all()
    found, wanted = (weighted_by(z, density, each, smooth=smooth) for each in (beyond, law))
    assert math.isfinite(wanted.k_hat)
    assert found.k_hat == wanted.k_hat
    assert np.array_equal(found.weights, wanted.weights)
    assert found.weights[:40].sum() == 0.0
    assert found.log_evidence == wanted.log_evidence
