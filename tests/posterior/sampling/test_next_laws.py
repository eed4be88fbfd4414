"""A law around one place has a width, also where that place alone counts."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.sampling import next_laws
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.proposal import Mixture, Proposal

D, DRAWS = 3, 400
START = Proposal(Mixture(np.zeros((1, D)), np.eye(D)[None], np.ones(1)), None, 0.5)


def local_of(z: NDArray[np.float64], target: NDArray[np.float64]) -> Any:
    each = START.log_density(z)
    pool = Pool(z, target, (START,), (len(z) - 1,), (each,), each)
    beyond, rng = np.array([False]), np.random.default_rng(2)
    return next_laws.next_laws(cast(Any, None), START, pool, beyond, rng)[2]


@pytest.fixture(autouse=True)
def straight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(next_laws, "coordinates_of", lambda _: None)


def test_where_one_draw_has_all_weight_the_law_is_as_wide_as_its_neighbours_lie() -> None:
    """A frame of something else makes densities of a million nats: the law had no width at all."""
    z = np.random.default_rng(1).standard_normal((DRAWS, D))
    target = np.zeros(DRAWS)
    target[7] = 1e6
    found = local_of(z, target)
    x = found.transport.unbend(z)[0]
    apart = x - x[7]
    nearest = np.argsort(np.square(apart).sum(axis=1))[: 10 * D]
    spread = apart[nearest].T @ apart[nearest] / len(nearest)
    factor = found.law.factors[0]
    np.testing.assert_allclose(factor @ factor.T, spread, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(found.law.centres[0], x[7])


class _Steep:
    """A map that has what is far away beyond all numbers."""

    def unbend(self, z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.where(np.abs(z) > 1e3, np.inf, z), np.zeros(len(z))


def test_a_draw_that_the_map_has_beyond_all_numbers_is_no_place_for_a_law(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steep = dataclasses.replace(START, transport=cast(Any, _Steep()))
    monkeypatch.setattr(next_laws, "fitted", lambda *_: steep)
    z = np.random.default_rng(1).standard_normal((DRAWS, D))
    target = START.log_density(z)
    target[9] += 3.0
    z[7], target[7] = 1e6, 0.0  # of all ratios the largest by far
    found = local_of(z, target)
    np.testing.assert_array_equal(found.law.centres[0], z[9])
    assert np.isfinite(found.law.factors).all()
