"""Valleys of a fit whose model errs: a point counts as far out as the mass beyond it says."""

import dataclasses
import itertools
import math
from typing import Any, cast

import numpy as np
import pytest
from scipy import integrate, stats

from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_valley import Step, as_far_as_mass_says, masses


@dataclasses.dataclass(frozen=True)
class _End:
    deviance: float = math.nan


def steps(*places: tuple[float, float]) -> list[Step]:
    return [Step(away, cost, cast(Erring, _End())) for away, cost in places]


def falls(side: list[Step], t: float) -> float:
    """Twice the fall of the log density at a distance: what `masses` supposes, said slowly."""
    first, last = side[0], side[-1]
    if t <= first.away or len(side) == 1:
        return first.cost * (t / first.away) ** 2
    if t <= last.away:
        return float(np.interp(t, [s.away for s in side], [s.cost for s in side]))
    before = side[-2]
    slope = (last.cost - before.cost) / (last.away - before.away)
    return last.cost + max(slope, 2.0 / last.away) * (t - last.away)


def mass(side: list[Step], low: float, high: float) -> float:
    def density(t: float) -> float:
        return math.exp(-0.5 * falls(side, t))

    points = [s.away for s in side if low < s.away < high]
    ends = [low, *points, high]
    return sum(integrate.quad(density, a, b)[0] for a, b in itertools.pairwise(ends))


SIDES: list[Any] = [
    [(2.0, 4.0)],
    [(2.0, 2.5), (4.0, 5.0), (8.0, 8.0), (16.0, 14.0)],
    [(2.0, 1.0), (4.0, 1.0), (8.0, 12.5)],
    [(1.0, 0.3), (3.0, 0.1), (7.0, 13.0)],
]


@pytest.mark.parametrize("places", SIDES)
def test_masses_are_integrals(places: list[tuple[float, float]]) -> None:
    side = steps(*places)
    ends = [0.0, *(s.away for s in side), 400.0]
    wanted = [mass(side, a, b) for a, b in itertools.pairwise(ends)]
    np.testing.assert_allclose(masses(side), wanted, rtol=1e-6)


def test_a_side_where_nothing_was_followed_is_normal() -> None:
    assert masses([]).sum() == pytest.approx(math.sqrt(0.5 * math.pi))
    assert masses(steps((2.0, 4.0))).sum() == pytest.approx(math.sqrt(0.5 * math.pi))


def test_a_normal_valley_adds_nothing() -> None:
    assert as_far_as_mass_says([steps((2.0, 4.0)), steps((2.0, 3.9))], 7.0) == []


def test_points_of_a_slow_fall_count_by_the_mass_beyond() -> None:
    """Deviances of 5 and 8 at 4 and 8 standard deviations: by these alone they lie 2.2 and 2.8
    out, and the truth would be there once in 36 and 200 times; by the mass it is more often."""
    slow, steep = steps(*SIDES[1]), steps((2.0, 4.0))
    found = as_far_as_mass_says([slow, steep], 7.0)
    whole = mass(slow, 0.0, 400.0) + mass(steep, 0.0, 400.0)
    wanted = [7.0 + stats.norm.isf(mass(slow, s.away, 400.0) / whole) ** 2 for s in slow]
    # up to the first beyond two standard deviations
    assert [one.deviance for one in found] == pytest.approx(wanted[: len(found)], rel=1e-6)
    assert [one.deviance - 7.0 > 4.0 for one in found] == [False, False, True]
    assert found[1].deviance - 7.0 < 0.8 * slow[1].cost


def test_beyond_an_end_of_what_is_possible_is_half_of_the_last_step() -> None:
    for side in (steps((2.0, 1.0)), steps((2.0, 1.0), (3.0, 1.2))):
        found = masses(side)
        assert found[-1] == 0.5 * found[-2]
    whole = masses(steps((2.0, 1.0)))[0] + masses(steps((2.0, 4.0))).sum()
    (edge,) = as_far_as_mass_says([steps((2.0, 1.0)), steps((2.0, 4.0))], 0.0)
    share = 0.5 * masses(steps((2.0, 1.0)))[0] / (whole + 0.5 * masses(steps((2.0, 1.0)))[0])
    assert edge.deviance == pytest.approx(stats.norm.isf(share) ** 2)


def test_half_of_the_mass_beyond_is_no_distance_at_all() -> None:
    flat = steps((2.0, 0.1), (4.0, 0.1), (8.0, 0.2), (16.0, 0.3))
    found = as_far_as_mass_says([flat, steps((2.0, 4.0))], 0.0)
    assert found[0].deviance == 0.0
