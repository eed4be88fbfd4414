"""No wrong number of roots, and no root off by more than a thousand roundings of its condition."""

from fractions import Fraction

import numpy as np
import pytest

from tests.extreme.certified import FAMILIES, roots_between, tally


@pytest.mark.parametrize("technique", FAMILIES)
def test_counts_are_exact_and_roots_are_sharp(technique: str) -> None:
    found = tally(technique, scenes=40, frames=12, rng=np.random.default_rng(20))
    assert found.frames > 400
    assert found.roots > 300
    assert found.wrong == []
    # of objects that drown in the wall's light a tenth lie at a fold to within rounding
    assert found.excused <= (0.2 * found.frames if technique == "background_intensity" else 0)
    assert found.worst < 1e3, found.where


def test_sturm_counts() -> None:
    """(x - 1)(x - 2)^2 (x^2 + 1) x and relatives: distinct roots, double ones once, 0 never."""

    def product(*factors: list[int]) -> list[Fraction]:
        out = [Fraction(1)]
        for factor in factors:
            new = [Fraction(0)] * (len(out) + len(factor) - 1)
            for i, a in enumerate(out):
                for j, b in enumerate(factor):
                    new[i + j] += a * b
            out = new
        return out

    p = product([1, -1], [1, -2], [1, -2], [1, 0, 1], [1, 0])
    assert roots_between(p, None) == 2
    assert roots_between(p, Fraction(2)) == 2
    assert roots_between(p, Fraction(3, 2)) == 1
    assert roots_between(p, Fraction(1, 2)) == 0
    assert roots_between([Fraction(0), Fraction(3)], None) == 0
    near = product([10**15, -(10**15)], [10**15, -(10**15) - 1])
    assert roots_between(near, Fraction(1)) == 1
    assert roots_between(near, None) == 2
