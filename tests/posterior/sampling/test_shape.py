"""Laplace shapes in straight coordinates, and how they follow draws."""

import dataclasses
import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.reparametrisation import Reparametrisation, reparametrisation_of
from inference.posterior.sampling.shape import followed, shape_at
from inference.posterior.sampling.start import climb, find_optima, refine, roughly
from inference.posterior.sampling.transport import fit_map, unbent_map
from tests.posterior.stages.confounded import confounded

Array = NDArray[np.float64]


@functools.cache
def _density() -> CollapsedDensity:
    return confounded().with_error_integrated().density()


def _coordinates() -> Reparametrisation:
    found = reparametrisation_of(_density())
    assert found is not None
    return found


@functools.cache
def _start() -> Array:
    """Where climbs in the unknowns themselves end."""
    exact = confounded().density()
    return find_optima(exact, np.random.default_rng(0), brief=True)[0].z


def test_the_top_is_reached_where_climbs_in_the_unknowns_stop_in_the_valley() -> None:
    shape = shape_at(_density(), _coordinates(), _start())
    before = refine(_density(), _start())
    assert shape is not None
    assert before is not None
    assert shape.optimum.log_density > before.log_density - 1e-3
    assert shape.optimum.log_density == pytest.approx(
        float(_density()(shape.optimum.z[None])[0]), abs=1e-9
    )
    # no neighbour a third of a standard deviation away is higher by more than the slope left over
    d = len(shape.optimum.z)
    steps = 0.3 * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    z, log_det = shape.transport.bend(steps)
    value = _density()(z) + log_det
    assert value[0] == pytest.approx(value.max(), abs=0.05)
    bends = (2.0 * value[0] - value[1 : d + 1] - value[d + 1 :]) / 0.3**2
    # the frame is of the last step but one
    assert np.all((bends > 0.2) & (bends < 5.0))


def test_a_shape_is_a_normal_law_in_its_coordinates() -> None:
    rng = np.random.default_rng(1)
    coordinates, d = _coordinates(), len(_start())
    scales = 10.0 ** np.linspace(-3, 0, d)
    centre = 0.1 * rng.standard_normal(d)
    factor = scales[:, None] * (np.eye(d) + np.tril(0.3 * rng.standard_normal((d, d)), -1))
    law = unbent_map(centre, factor, coordinates)
    x = rng.standard_normal((200, d))
    z, log_det = law.bend(x)
    back, backward = law.unbend(z)
    np.testing.assert_allclose(back, x, atol=1e-9)
    np.testing.assert_allclose(log_det, -backward, atol=1e-9)
    np.testing.assert_allclose(log_det, np.log(np.abs(np.diagonal(factor))).sum(), atol=1e-9)
    deviation = (coordinates.forward(z) - centre).T
    squares = np.sum(np.linalg.solve(factor, deviation) ** 2, axis=0)
    np.testing.assert_allclose(squares, np.sum(x**2, axis=1), rtol=1e-8)
    moved = law.moved(np.ones(d), 2.0 * np.eye(d))
    inside = law.unbend(moved.bend(np.zeros((1, d)))[0])[0][0]
    np.testing.assert_allclose(inside, np.ones(d), atol=1e-9)


def test_a_map_that_bends_is_not_moved() -> None:
    rng = np.random.default_rng(2)
    z = rng.standard_normal((800, 3))
    z[:, 2] += z[:, 0] ** 2
    with pytest.raises(ValueError, match="bends"):
        fit_map(z).moved(np.zeros(3), np.eye(3))


@dataclasses.dataclass(frozen=True)
class _Normal:
    """A normal law in straight coordinates."""

    mean: Array
    factor: Array

    def log_density(self, y: Array) -> Array:
        x = np.linalg.solve(self.factor, (y - self.mean).T)
        return np.asarray(-0.5 * np.sum(x**2, axis=0))


def _pool(law: Array, target: _Normal, n: int, seed: int) -> tuple[Pool, object]:
    """Draw from a normal law around zero with this factor, in straight coordinates."""
    rng, coordinates = np.random.default_rng(seed), _coordinates()
    d = len(law)
    transport = unbent_map(np.zeros(d), law, coordinates)
    x = rng.standard_normal((n, d))
    z = transport.bend(x)[0]
    proposed = -0.5 * np.sum(x**2, axis=1)
    value = target.log_density(coordinates.forward(z))
    return Pool(z, value, (), (1,), (proposed,), proposed), transport


@pytest.mark.parametrize(("wrong", "draws"), [(3.0, 400), (0.5, 400)])
def test_log_densities_of_few_draws_tell_a_normal_law_exactly(wrong: float, draws: int) -> None:
    """Of draws from a law three times too wide, or half as wide, and beside it, hardly any count.

    Their log densities are a quadratic function all the same: what is fitted is exact up to the
    ridge, a ten thousandth of a scaled column. Means and covariances of so few would be off by a
    third.
    """
    rng = np.random.default_rng(3)
    d = len(_start())
    target = _Normal(0.3 * rng.standard_normal(d), np.tril(0.1 * rng.standard_normal((d, d))))
    target.factor[np.diag_indices(d)] = 1.0
    pool, transport = _pool(wrong * np.eye(d), target, draws, 4)
    found = followed(transport, pool, 0)  # type: ignore[arg-type]
    x = np.random.default_rng(5).standard_normal((50, d))
    y = _coordinates().forward(found.bend(x)[0])
    squares = -2.0 * target.log_density(y)
    np.testing.assert_allclose(squares, np.sum(x**2, axis=1), rtol=0.02, atol=0.02)


def test_many_draws_tell_mean_and_covariance_themselves() -> None:
    """A law with heavier tails than normal: its curvature at the top is narrower than it is."""
    d = len(_start())
    rng = np.random.default_rng(6)
    x = rng.standard_normal((4000, d)) * np.sqrt(5.0 / rng.chisquare(5.0, (4000, 1)))
    transport = unbent_map(np.zeros(d), np.eye(d), _coordinates())
    z = transport.bend(x)[0]
    flat = np.zeros(len(z))
    found = followed(transport, Pool(z, flat, (), (1,), (flat,), flat), 0)
    inside = transport.unbend(found.bend(np.eye(d))[0])[0]
    widths = np.linalg.norm(inside - transport.unbend(found.bend(np.zeros((1, d)))[0])[0], axis=1)
    # variance 5/3; its estimate from 4,000 draws of kurtosis 9 errs by 4.5 %
    np.testing.assert_allclose(widths, np.sqrt(5.0 / 3.0), rtol=0.12)


def test_no_draw_of_weight_leaves_the_shape() -> None:
    d = len(_start())
    transport = unbent_map(np.zeros(d), np.eye(d), _coordinates())
    z, none = np.zeros((5, d)), np.full(5, -np.inf)
    assert followed(transport, Pool(z, none, (), (1,), (np.zeros(5),), none), 0) is transport


def test_a_rough_optimum_is_where_the_climb_ended() -> None:
    exact = confounded().density()
    z = climb(exact, _start())[0]
    rough = roughly(exact, z)
    assert rough is not None
    np.testing.assert_array_equal(rough.z, z)
    assert rough.log_density == float(exact(z[None])[0])
    assert np.all(np.diagonal(rough.factor) > 0)
    assert not np.triu(rough.factor, 1).any()
