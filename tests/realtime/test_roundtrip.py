"""Round trip of every technique against the mpmath reference: roots and their count."""

import numpy as np
import pytest

from inference.estimate import all_roots
from tests.realtime import reference
from tests.realtime.roundtrip import VARIANTS, check, request
from tests.thorough import first

# benchmarks/realtime_roundtrip.py runs as many cases as one likes
CASES = range(12)
EPSILON = float(np.finfo(float).eps)


@pytest.mark.slow
@pytest.mark.parametrize(("technique", "pulsed"), VARIANTS)
def test_round_trip(technique: str, pulsed: bool) -> None:
    rng = np.random.default_rng([17, VARIANTS.index((technique, pulsed))])
    for _ in first(5, CASES):
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
    """The reading at which the count of roots changes, and 8 epsilons to either side.

    It is looked for by the counts that are tested; were it another one than the reference's, these
    would differ on one side of it.
    """
    rng = np.random.default_rng(23)
    folds = 0
    while folds < 4:
        case = reference.random_case(technique, True, rng)
        first, second = reference.forward(case)

        def roots(
            factor: float,
            case: reference.Case = case,
            first: float = first,
            second: float = second,
        ) -> int:
            found = all_roots(technique, *request(case, first, second * factor))
            return int(found.root_count[0])

        here, low, high = roots(1.0), 1.0, 0.0
        for factor in (1.3, 0.7, 1.05, 0.95):
            if roots(factor) != here:
                high = factor
                break
        if high == 0.0:
            continue
        ends = (1.0, high)
        while low < (middle := 0.5 * (low + high)) < high or high < middle < low:
            if roots(middle) == here:
                low = middle
            else:
                high = middle
        folds += 1
        for factor in (*ends, *(low * (1 + steps * EPSILON) for steps in (-1000, -8, 8, 1000))):
            expected = len(reference.reference_roots(case, first, second * factor))
            assert roots(factor) == expected, (case, factor)
