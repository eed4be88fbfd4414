"""A branch of some thousandths that jumps hardly reach: it is noticed, and jumps lead there."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.sampling.diagnostics import effective_sample_size
from inference.posterior.sampling.ensemble import advance, new_ensemble
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.proposal import Local, Mixture, Proposal, completed
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.verdict import Chains, Verdict, judge
from inference.posterior.stages import walking
from inference.posterior.stages.stage import Walking
from tests.posterior.sampling.surrogate import cheap, optima_of

Array = NDArray[np.float64]

BRANCH, WIDTH, SHARE = np.array([5.0, 0.0]), 0.2, 0.004
BARE = Proposal(optima_of("normal", 2), None, 0.5)
STEPS = 250


def _target(z: Array) -> Array:
    rest = math.log1p(-SHARE) - 0.5 * (z**2).sum(axis=1)
    branch = -0.5 * (((z - BRANCH) / WIDTH) ** 2).sum(axis=1) - 2 * math.log(WIDTH)
    return np.asarray(np.logaddexp(rest, math.log(SHARE) + branch) - math.log(2 * math.pi))


def _drawn(n: int) -> WeightedDraws:
    """Draw from the target itself."""
    rng = np.random.default_rng(1)
    z = rng.standard_normal((n, 2))
    count = round(SHARE * n)
    z[:count] = BRANCH + WIDTH * z[:count]
    return WeightedDraws(z, _target(z), np.full(n, 1 / n), -math.inf, 0.0)


def _laws() -> list[Local]:
    """Return laws around two places, in the order that is not wanted."""
    straight = fit_map(np.random.default_rng(2).standard_normal((500, 2)))
    places = straight.unbend(np.array([[-1.0, 1.0], BRANCH]))[0]
    return [Local(straight, Mixture(x[None], WIDTH * np.eye(2)[None], np.ones(1))) for x in places]


def _walked(proposal: Proposal, seed: int) -> Chains:
    density, made = cheap(_target), []
    for k in range(4):
        z = np.random.default_rng([seed, k]).standard_normal((32, 2))
        key = np.random.SeedSequence(seed, spawn_key=(k,))
        ensemble = new_ensemble(proposal, z, _target(z), key)
        made.append(advance(density, proposal, ensemble, STEPS))
    stage = Walking(proposal, tuple(made), Verdict(False, ()), adaptations=0)
    return stage.chains(("a", "b"))


def _inside(z: Array) -> NDArray[np.bool_]:
    """Return which points belong to the branch; of the others one in a thousand million does."""
    return np.asarray(np.linalg.norm(z - BRANCH, axis=-1) < 5 * WIDTH)


@pytest.fixture(scope="module")
def stayed() -> Chains:
    return _walked(BARE, 1)


def test_walkers_that_stay_where_no_jump_leads_are_noticed(stayed: Chains) -> None:
    """Every gate that looks at unknowns and log density is passed."""
    assert judge(dataclasses.replace(stayed, log_ratio=None), 100).converged
    (reason,) = judge(stayed, 100).reasons
    assert "a branch there may be told too little" in reason


def test_they_call_for_populations_once(stayed: Chains) -> None:
    assert not walking.is_slow(dataclasses.replace(stayed, log_ratio=None), 0)
    assert walking.is_slow(stayed, 0)
    assert not walking.is_slow(stayed, 1)


def test_a_branch_gets_the_law_that_stands_there() -> None:
    laws, draws = _laws(), _drawn(5000)
    found = completed(BARE, laws, draws)
    assert found.more == (laws[1],)
    # tenfold the posterior over what jumps propose, at most
    assert (draws.log_density - found.log_density(draws.z)).max() < math.log(10.0)


def test_nothing_is_added_where_nothing_is_wanting() -> None:
    draws = _drawn(5000)
    some = ~_inside(draws.z)
    rest = WeightedDraws(draws.z[some], draws.log_density[some], draws.weights[some], 0.0, 0.0)
    assert completed(BARE, _laws(), rest) is BARE
    assert completed(BARE, _laws()[:1], draws) is BARE  # a law elsewhere is of no use


def test_with_its_law_a_branch_has_its_weight() -> None:
    chains = _walked(completed(BARE, _laws(), _drawn(5000)), 1)
    assert judge(chains, 100).converged
    inside = _inside(chains.z).astype(float)
    error = inside.std() / math.sqrt(effective_sample_size(inside))
    assert error < SHARE / 4  # of 25,600 draws every fourth is new: 6e-4
    assert abs(inside.mean() - SHARE) < 5 * error  # a false alarm in 2e6


def test_a_proposal_s_draws_follow_its_density() -> None:
    """The mean of any law's density by that drawn from is one: here of a wide normal one."""
    proposal = completed(BARE, _laws(), _drawn(5000))
    z = proposal.draw(np.random.default_rng(5), 20_000)
    # within the draws' reach, and no less there than a tenth of the branch's own law
    law = -0.5 * (((z - BRANCH) / (2 * WIDTH)) ** 2).sum(axis=1)
    ratio = np.exp(law - math.log(2 * math.pi * 4 * WIDTH**2) - proposal.log_density(z))
    assert abs(ratio.mean() - 1) < 5 * ratio.std() / math.sqrt(len(z))  # a false alarm in 2e6
    assert ratio.std() / math.sqrt(len(z)) < 0.05


def test_what_lies_beyond_all_numbers_in_a_maps_coordinates_has_no_density() -> None:
    """Its square over the others' was none, and weights from it neither."""
    law = _laws()[1]
    near = law.law.centres
    z = law.transport.bend(near)[0]
    far = np.array([[1e300, 0.0], [np.inf, 0.0]])
    narrow = dataclasses.replace(
        law, transport=dataclasses.replace(law.transport, axes=1e-150 * law.transport.axes)
    )
    assert not np.isfinite(narrow.transport.unbend(far)[0]).all()
    assert np.isneginf(narrow.log_density(far)).all()
    assert np.isneginf(Proposal(BARE.optima, narrow.transport, 0.5).log_density(far)).all()
    # among others they change nothing
    both = law.log_density(np.vstack([z, far[1:]]))
    np.testing.assert_array_equal(both[:1], law.log_density(z))
