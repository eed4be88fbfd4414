"""Draws of many laws at once: their shares, and what suits a target best."""

import dataclasses

import numpy as np
import pytest
from scipy import optimize, stats

from inference.posterior.sampling.pool import Pool, drawn_by, mixed, shares_that_suit
from inference.posterior.sampling.proposal import Mixture, Proposal

CENTRES = (0.0, 4.0, 9.0)
COUNTS = (3000, 3000, 2000)
LAWS = tuple(
    Proposal(Mixture(np.array([[centre]]), np.eye(1)[None], np.ones(1)), None, 0.5)
    for centre in CENTRES
)


def _target(z: np.ndarray) -> np.ndarray:
    """Two bells of unequal mass where two of the laws lie, and nothing at the third."""
    x = np.asarray(z)[:, 0]
    one, two = stats.norm(0.0, 0.8).logpdf(x), stats.norm(4.0, 0.8).logpdf(x)
    return np.asarray(np.logaddexp(one + np.log(0.9), two + np.log(0.1)))


def _pool(factor: float = 0.0) -> Pool:
    rng = np.random.default_rng(1)
    z = np.concatenate([law.draw(rng, n) for law, n in zip(LAWS, COUNTS, strict=True)])
    each = tuple(law.log_density(z) for law in LAWS)
    return Pool(z, _target(z) + factor, LAWS, COUNTS, each, each[0])


def test_shares_are_those_of_the_least_mean_square() -> None:
    """Held to a slow minimiser over the same draws."""
    pool = _pool()
    shares, effective = shares_that_suit(pool, 0)
    given = np.array(COUNTS) / sum(COUNTS)
    weights = np.exp(pool.log_ratios)
    ratios = np.exp(np.array(pool.each) - mixed(pool.each, COUNTS))

    def mean_square(own: np.ndarray) -> float:
        moved = np.exp(own - np.max(own))
        mixture = (0.5 * given + 0.5 * moved / moved.sum()) @ ratios
        return float(np.mean(weights**2 / mixture))

    best = optimize.minimize(mean_square, np.zeros(3), method="Nelder-Mead", tol=1e-10)
    found = float(np.mean(weights**2 / (shares @ ratios)))
    # the slope of the last of thirty steps leaves a thousandth
    assert best.fun <= found * (1 + 1e-9) < 1.001 * best.fun
    assert found < 0.7 * float(np.mean(weights**2))  # by which draws of the given shares fall short
    assert effective == pytest.approx(np.mean(weights) ** 2 / found, rel=1e-12)
    assert shares.sum() == pytest.approx(1.0, rel=1e-12)
    assert (shares >= 0.5 * given * (1 - 1e-12)).all()


@pytest.mark.parametrize("factor", [-1e6, 700.0, 1e6])
def test_shares_do_not_depend_on_the_size_of_the_target(factor: float) -> None:
    shares, effective = shares_that_suit(_pool(factor), 0)
    plain, share = shares_that_suit(_pool(), 0)
    # adding to logarithms of 1e6 costs ten digits
    assert np.abs(shares - plain).max() < 1e-8
    assert effective == pytest.approx(share, rel=1e-8)


def test_draws_without_a_weight_and_members_change_nothing() -> None:
    """What lies where the target is zero counts as a draw, members of populations do not."""
    pool = _pool()
    empty = dataclasses.replace(pool, target=np.where(pool.z[:, 0] > 6.5, -np.inf, pool.target))
    shares, effective = shares_that_suit(empty, 0)
    assert np.isfinite(shares).all()
    assert shares[2] == pytest.approx(0.5 * COUNTS[2] / sum(COUNTS), rel=1e-3)
    assert 0.5 < effective < 1.0
    nothing = dataclasses.replace(pool, target=np.full(len(pool.z), -np.inf))
    assert shares_that_suit(nothing, 0)[1] == 0.0
    members = Pool(
        np.concatenate([pool.z[:500], pool.z]),
        np.concatenate([pool.target[:500] + 50.0, pool.target]),
        LAWS,
        COUNTS,
        tuple(np.concatenate([one[:500], one]) for one in pool.each),
        np.concatenate([pool.laplace[:500], pool.laplace]),
    )
    assert np.array_equal(shares_that_suit(members, 500)[0], shares_that_suit(pool, 0)[0])


def test_draws_come_from_each_law_by_its_share() -> None:
    shares = np.array([0.7, 0.0, 0.3])
    drawn = drawn_by(_pool(), shares, 1001, np.random.default_rng(2))
    assert drawn.counts in ((701, 0, 300), (700, 0, 301))
    assert drawn.z.shape == (1001, 1)
    assert np.array_equal(drawn.open, drawn.z)
    values = _target(drawn.z)
    part = drawn.evaluated(values[:7])
    assert np.array_equal(part.open, drawn.z[7:])
    assert np.array_equal(part.evaluated(values[7:]).target, values)
    near = np.abs(drawn.z[:, 0] - CENTRES[2]) < np.abs(drawn.z[:, 0] - CENTRES[0])
    # 2 % of a Student-t law of five degrees lie beyond the middle, 4.5 away: five sd of the counts
    assert abs(np.count_nonzero(near) - 300) < 5 * np.sqrt(0.02 * 1001)


def test_draws_in_many_parts_come_from_each_law_by_its_share() -> None:
    """Planted fault: rounded the same way in every part, a law never gave its half of a draw."""
    shares, rng = np.array([0.81, 0.14, 0.05]), np.random.default_rng(2)
    parts = [drawn_by(_pool(), shares, 10, rng).counts for _ in range(400)]
    assert np.abs(np.array(parts) - 10 * shares).max() < 1.0
    assert {sum(counts) for counts in parts} == {10}
    # a count above or below has a standard deviation of at most a half: five of the mean's
    assert np.abs(np.mean(parts, axis=0) - 10 * shares).max() < 5 * 0.5 / np.sqrt(400)


def test_a_mixture_of_laws_is_a_density() -> None:
    grid = np.linspace(-60.0, 70.0, 40_001)
    each = np.array([law.log_density(grid[:, None]) for law in LAWS])
    # Student-t laws of five degrees hold less than 1e-6 beyond
    assert np.trapezoid(np.exp(mixed(each, COUNTS)), grid) == pytest.approx(1.0, abs=1e-5)
