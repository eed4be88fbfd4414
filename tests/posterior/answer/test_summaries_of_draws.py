"""Means, their Monte Carlo errors and quantiles of draws against theory and against other runs."""

import math

import numpy as np
import pytest
from scipy import signal

from inference.posterior.answer.error_parts import ErrorParts
from inference.posterior.answer.parameter_summary import summaries_of_chains, summaries_of_weights
from inference.posterior.answer.quantiles import weighted_quantiles

NOISE_ALONE = ErrorParts(np.ones(1), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_the_error_of_a_mean_of_walkers(rho: float) -> None:
    """Autoregressions of unit variance: the variance of their mean is (1 + rho) / (1 - rho) / n.

    It is estimated from some 400 independent values an ensemble and the spread of four ensembles,
    and known to a tenth; the band is two of that, and a factor of sqrt(2) is four.
    """
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((4, 32, 1200, 1))
    noise[:, :, 1:] *= math.sqrt(1 - rho**2)
    draws = signal.lfilter([1.0], [1.0, -rho], noise, axis=2)
    found = summaries_of_chains(("a",), draws, draws, NOISE_ALONE)["a"]
    wanted = math.sqrt((1 + rho) / (1 - rho) / draws.size)
    assert found.mcse_mean == pytest.approx(wanted, rel=0.2)
    assert found.mcse_mean == pytest.approx(found.sd / math.sqrt(found.ess_bulk), rel=1e-12)
    assert abs(found.mean) < 5 * wanted


def test_the_error_of_a_mean_of_weighted_draws() -> None:
    """Against 400 runs: their scatter is known to 3.5 %, the band is five of that."""
    rng, n, shift = np.random.default_rng(4), 400, 1.0
    means, errors = [], []
    for _ in range(400):
        x = rng.standard_normal((n, 1))
        weights = np.exp(shift * x[:, 0] - 0.5 * shift**2)  # from N(0, 1) to N(1, 1)
        found = summaries_of_weights(("a",), x, weights / weights.sum(), NOISE_ALONE)["a"]
        if math.isfinite(found.mean):  # else two modes were seen
            means.append(found.mean)
            errors.append(found.mcse_mean)
    assert len(means) > 350
    stated = float(np.sqrt(np.mean(np.square(errors))))
    assert np.std(means) == pytest.approx(stated, rel=0.18)


def test_quantiles_of_equal_weights_are_symmetric() -> None:
    """The middle of five is the third, and as far from either end for 5 as for 95 %."""
    x, equal = np.array([3.0, 1.0, 5.0, 2.0, 4.0]), np.full(5, 0.2)
    q05, q50, q95 = weighted_quantiles(x, equal, several_modes=False)
    assert q50 == pytest.approx(3.0, rel=1e-14)
    assert q05 - 1.0 == pytest.approx(5.0 - q95, abs=1e-14)
    doubled = weighted_quantiles(np.repeat(x, 2), np.full(10, 0.1), several_modes=True)
    assert doubled[1] == 3.0
