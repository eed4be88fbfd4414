"""Joint fits beside an optimum in 50 digits; more in `make stress`."""

import math

import pytest

from tests.extreme.optima import CASES, excess_of, fit_miss


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("snr", [1e6, 1e12])
def test_a_fit_is_the_optimum(kind: str, case: str, snr: float) -> None:
    """To a thousandth of chi-square, which the climb may leave, and the rounding of readings."""
    miss = fit_miss(kind, case, snr)
    assert not miss.refused
    assert math.isfinite(miss.excess)
    assert excess_of(miss) < 1
    assert miss.moved < 0.03  # the root of what may be left


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_what_noise_drowns_is_refused_or_the_optimum(kind: str) -> None:
    for case in CASES:
        miss = fit_miss(kind, case, 1e-2)
        assert miss.refused or excess_of(miss) < 1
