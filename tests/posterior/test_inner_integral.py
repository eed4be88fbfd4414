"""The frame integral against its slow reference, on random and extreme frames."""

import numpy as np
import pytest

from inference.posterior.collapsed import collapsed_density
from tests.posterior.reference import Case, random_case, reference

NAT = 1e-3  # what a frame may be wrong by


def integrated(case: Case) -> float:
    density = collapsed_density(case.sensor, case.scene, case.frames)
    return float(density.log_likelihood(np.empty((1, 0)))[0])


@pytest.mark.parametrize(("seed", "count"), [(3, 40), pytest.param(4, 300, marks=pytest.mark.slow)])
def test_random_frames(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    for k in range(count):
        case = random_case(rng)
        assert integrated(case) == pytest.approx(reference(case), abs=NAT), (seed, k)


def test_a_dip_beside_the_top() -> None:
    """A relative error far above the read noise makes the density rise again beyond a dip, so the
    slope at a neighbouring knot points away from the top."""
    rng = np.random.default_rng(1)
    case = [random_case(rng) for _ in range(1979)][-1]
    assert case.sensor.noise.relative > 0
    assert integrated(case) == pytest.approx(reference(case), abs=NAT)
