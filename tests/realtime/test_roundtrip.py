"""Round trip of every technique against the mpmath reference: roots and their count."""

import numpy as np
import pytest

from inference.estimate import all_roots
from tests.realtime import reference
from tests.realtime.roundtrip import VARIANTS, check, request

# benchmarks/realtime_roundtrip.py runs as many cases as one likes
CASES = 12
EPSILON = float(np.finfo(float).eps)


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


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["intensity", "differential", "background_cancelling"])
def test_counts_agree_on_both_sides_of_a_fold(technique: str) -> None:
    """The reading at which the reference's count changes, and 8 epsilons to either side."""
    rng = np.random.default_rng(23)
    folds = 0
    while folds < 4:
        case = reference.random_case(technique, True, rng)
        first, second = reference.forward(case)

        def count(factor: float, case: reference.Case = case) -> int:
            pair = reference.forward(case)
            return len(reference.reference_roots(case, pair[0], pair[1] * factor))

        here, low, high = count(1.0), 1.0, 0.0
        for factor in (1.3, 0.7, 1.05, 0.95):
            if count(factor) != here:
                high = factor
                break
        if high == 0.0:
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            if count(middle) == here:
                low = middle
            else:
                high = middle
        folds += 1
        for steps in (-1000, -8, 8, 1000):
            reading = second * low * (1 + steps * EPSILON)
            expected = len(reference.reference_roots(case, first, reading))
            sensor, scene, frames = request(case, first, reading)
            found = all_roots(technique, sensor, scene, frames)
            assert found.root_count[0] == expected, (case, steps)
