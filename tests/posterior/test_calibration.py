"""Simulation-based calibration, small: twenty data sets a scene."""

import pytest
from scipy import stats

from tests.posterior.calibration import ranks, setting

SETS = 20
ALARM = 1e-3  # of each scene, shared among its tests


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "crosstalk", "snr"), [("pulsed", True, 1000.0), ("sine_wave", False, 10.0)]
)
def test_truths_rank_evenly_among_the_draws(kind: str, crosstalk: bool, snr: float) -> None:
    """Kolmogorov-Smirnov on each unknown and on two frames' ranges; false alarms 1e-3 a scene."""
    found = [ranks(*setting(kind, crosstalk, snr), seed) for seed in range(SETS)]
    assert sum(result.converged for result in found) == SETS
    names = list(found[0].values)
    for name in names:
        sample = [result.values[name] for result in found]
        assert stats.kstest(sample, "uniform").pvalue > ALARM / len(names), name
