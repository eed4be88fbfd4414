"""Every gate fires on what it is for, and rarely on healthy runs."""

import dataclasses

import numpy as np
import pytest
from scipy import signal, stats

from inference.posterior.sampling.diagnostics import autocorrelation_time
from inference.posterior.sampling.verdict import Chains, judge

NAMES = ("a", "b", "c")


def healthy(
    seed: int, steps: int = 300, rho: float = 0.5, ensembles: int = 4, walkers: int = 32
) -> Chains:
    """Independent walkers, each a first-order autoregression with unit variance."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((ensembles, walkers, steps, len(NAMES)))
    noise[:, :, 1:] *= np.sqrt(1 - rho**2)
    z = signal.lfilter([1.0], [1.0, -rho], noise, axis=2)
    log_density = -0.5 * (z**2).sum(axis=-1)
    mode = np.zeros(log_density.shape, dtype=np.intp)
    return Chains(z, log_density, mode, np.full((ensembles, walkers), 0.5), NAMES)


def with_z(chains: Chains, z: np.ndarray) -> Chains:
    return dataclasses.replace(chains, z=z)


def test_false_alarms_are_rare() -> None:
    """Healthy runs of 100 autocorrelation times, allowed to fail at a rate of 1e-3.

    The band is binomial; this test's own false-alarm rate is below 1e-3. Hundreds of runs are those
    of `python -m benchmarks.verdict_gates`.
    """
    runs = 40
    alarms = sum(not judge(healthy(seed), 400).converged for seed in range(runs))
    assert alarms <= int(stats.binom.isf(1e-3, runs, 1e-3))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8])
def test_the_autocorrelation_time_is_that_of_the_process(rho: float) -> None:
    """(1 + rho) / (1 - rho), summed over a window of five of them: of n steps in all its relative
    sd is sqrt(2 (2 window + 1) / n) (Sokal 1997), here up to 3.5 %; bands of five sd."""
    series = healthy(5, steps=1200, rho=rho).z[..., 0].reshape(-1, 1200).T
    wanted = (1 + rho) / (1 - rho)
    error = np.sqrt(2 * (2 * 5 * wanted + 1) / series.size)
    assert autocorrelation_time(series) == pytest.approx(wanted, rel=5 * error)


def test_shared_stream_is_named() -> None:
    chains = healthy(1)
    z = chains.z.copy()
    z[2] = z[0]
    verdict = judge(with_z(chains, z), 400)
    assert not verdict.converged
    assert "share a stream" in verdict.reasons[0]


def test_start_outside_the_support_is_named() -> None:
    chains = healthy(1)
    log_density = chains.log_density.copy()
    log_density[1, 3] = -np.inf
    verdict = judge(dataclasses.replace(chains, log_density=log_density), 400)
    assert "density is zero" in verdict.reasons[0]


def test_stuck_walker_is_named() -> None:
    chains = healthy(1)
    z = chains.z.copy()
    z[1, 7] = z[1, 7, :1]
    verdict = judge(with_z(chains, z), 400)
    assert "never moved" in verdict.reasons[0]


def test_low_acceptance_is_named() -> None:
    chains = dataclasses.replace(healthy(1), acceptance=np.full((4, 32), 0.01))
    assert "accepted only" in judge(chains, 400).reasons[0]


def test_too_few_steps_are_named() -> None:
    verdict = judge(healthy(1, steps=60, rho=0.9), 10)
    assert "autocorrelation times" in verdict.reasons[0]


def test_a_constant_parameter_is_not_converged() -> None:
    chains = healthy(1)
    z = chains.z.copy()
    z[..., 1] = 0.25
    reasons = judge(with_z(chains, z), 400).reasons
    assert any("not finite" in reason for reason in reasons)


@pytest.mark.parametrize("shift", [0.5, 5.0])
def test_one_ensemble_in_a_wrong_mode_is_named(shift: float) -> None:
    chains = healthy(1)
    z = chains.z.copy()
    z[3, ..., 2] += shift
    reasons = judge(with_z(chains, z), 400).reasons
    assert any("R-hat of c" in reason for reason in reasons)


def test_ensembles_that_drift_together_are_named() -> None:
    """Halves that differ by half a standard deviation: R-hat 1.035, though ensembles agree."""
    chains = healthy(1)
    z = chains.z.copy()
    z[..., 2] += np.linspace(-0.5, 0.5, z.shape[2])
    reasons = judge(with_z(chains, z), 400).reasons
    assert any("R-hat of c" in reason for reason in reasons)


def test_a_small_but_real_disagreement_is_named() -> None:
    """A tenth of a standard deviation stays below R-hat 1.01 but not below the means' errors."""
    chains = healthy(1, steps=3000, rho=0.0)
    z = chains.z.copy()
    z[3, ..., 2] += 0.1
    reasons = judge(with_z(chains, z), 400).reasons
    assert any("means of c differ" in reason for reason in reasons)


def test_modes_without_transitions_are_named() -> None:
    chains = healthy(1)
    mode = chains.mode.copy()
    mode[:, :8] = 1  # a quarter of the walkers of every ensemble, for good
    reasons = judge(dataclasses.replace(chains, mode=mode), 400).reasons
    assert any("entered mode" in reason for reason in reasons)


def test_an_effective_sample_size_below_the_target_is_named() -> None:
    reasons = judge(healthy(1), 10_000_000).reasons
    assert any("effective sample size" in reason for reason in reasons)


def test_no_steps_are_not_converged() -> None:
    verdict = judge(healthy(1, steps=2), 1)
    assert not verdict.converged
    assert "too few" in verdict.reasons[0]
