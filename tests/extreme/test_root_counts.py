"""No wrong number of roots, and no root off by more than a thousand roundings of its condition."""

from fractions import Fraction

import numpy as np
import pytest

from inference.estimate import all_roots
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.extreme.certified import FAMILIES, Extreme, root_error, tally
from tests.extreme.sturm import roots_between


@pytest.mark.parametrize("technique", FAMILIES)
def test_counts_are_exact_and_roots_are_sharp(technique: str) -> None:
    # a chain of degree 8 takes twenty times as long
    scenes = 3 if technique == "background_cancelling_differential" else 40
    found = tally(technique, scenes, frames=12, rng=np.random.default_rng(20))
    assert found.frames > 10 * scenes
    assert found.roots > 7 * scenes
    assert found.wrong == []
    # of objects that drown in the wall's light a tenth lie at a fold to within rounding
    drown = technique in ("background_intensity", "background_cancelling_differential")
    assert found.excused <= (0.2 * found.frames if drown else 0)
    assert found.worst < 1e3, found.where


DROWNED = Extreme(
    technique="background_cancelling_differential",
    pulse_width_s=0.0013645983226463277,
    gain=4.845846139298153e-06,
    c0=36813.20294351297,
    c1=-1.1408519922644251e-05,
    c2=0.0028727744941524835,
    distance=201180.3839291687,
    strength=1137089477.3511124,
    c0s=2312.898313332519,
    c1s=647.2171794484632,
)
NEAR = Extreme(
    technique="background_cancelling_differential",
    pulse_width_s=5.452648469841165e-07,
    gain=4750005586.687271,
    c0=0.00022544948827570566,
    c1=8.068680513798868e-07,
    c2=0.02344569232864975,
    distance=27.95191998337227,
    strength=23396477.010792464,
    c0s=6.066463841277641e-07,
    c1s=2.060800431028307e-05,
)


@pytest.mark.parametrize(
    ("e", "readings"),
    [
        # turning points of a ratio that is one number to rounding were that rounding: 855 roots
        (DROWNED, (0.000652444996123893, 0.000663366922467041)),
        # R is some billion times the range
        (NEAR, (-2.253955199287768e20, -4.738780956383693e29)),
    ],
)
def test_a_wall_far_brighter_or_farther_leaves_the_roots_sharp(
    e: Extreme, readings: tuple[float, float]
) -> None:
    given = Frames(np.ones((1, 2)), time_s=np.zeros(1), derivatives=np.array([readings]))
    result = all_roots(e.technique, e.sensor, parse_scene(e.document), given)
    roots = result.roots_m[0, : result.root_count[0]].tolist()
    assert len(roots) <= 2
    assert all(root_error(e, *readings, root) < 10 for root in roots)


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
