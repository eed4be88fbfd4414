"""Round trip of every technique against the mpmath reference: roots and their count."""

import numpy as np
import pytest

from tests.realtime import reference
from tests.realtime.roundtrip import VARIANTS, check

# benchmarks/realtime_roundtrip.py runs as many cases as one likes
CASES = 12


@pytest.mark.slow
@pytest.mark.parametrize(("technique", "pulsed"), VARIANTS)
def test_round_trip(technique: str, pulsed: bool) -> None:
    rng = np.random.default_rng([17, VARIANTS.index((technique, pulsed))])
    for _ in range(CASES):
        case = reference.random_case(technique, pulsed, rng)
        verdict = check(case)
        assert verdict.good, (case, verdict)


@pytest.mark.parametrize(("technique", "pulsed"), VARIANTS[:5])
def test_round_trip_quickly(technique: str, pulsed: bool) -> None:
    rng = np.random.default_rng([18, VARIANTS.index((technique, pulsed))])
    for _ in range(5):
        case = reference.random_case(technique, pulsed, rng)
        verdict = check(case)
        assert verdict.good, (case, verdict)
