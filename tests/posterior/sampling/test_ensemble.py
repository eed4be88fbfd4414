"""Ensembles: reproducible, resumable, each with a random stream of its own."""

import dataclasses
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.sampling.ensemble import Ensemble, advance, new_ensemble, restart
from inference.posterior.sampling.proposal import Mixture, Proposal, mixture_of
from inference.posterior.sampling.start import find_optima
from inference.posterior.sampling.transport import fit_map
from tests.posterior.scenes import example

Array = NDArray[np.float64]


@pytest.fixture(scope="module", params=["Laplace", "map"])
def target(request: pytest.FixtureRequest) -> tuple[CollapsedDensity, Proposal]:
    density = collapsed_density(*example("pulsed", crosstalk=True))
    optima = mixture_of(find_optima(density, np.random.default_rng(1)))
    if request.param == "Laplace":
        return density, Proposal(optima, None, 0.5)
    transport = fit_map(optima.draw(np.random.default_rng(2), 500))
    return density, Proposal(optima, transport, 0.5)


def _new(target: tuple[CollapsedDensity, Proposal], key: int) -> Ensemble:
    density, proposal = target
    z = proposal.optima.draw(np.random.default_rng(3), 32)
    return new_ensemble(proposal, z, density(z), np.random.SeedSequence(key))


def test_chunks_do_not_change_the_chain(target: tuple[CollapsedDensity, Proposal]) -> None:
    whole = advance(*target, _new(target, 5), 30)
    pieces = _new(target, 5)
    for steps in (1, 7, 22):
        pieces = advance(*target, pieces, steps)
    assert np.array_equal(whole.chain, pieces.chain)
    assert np.array_equal(whole.chain_log_prob, pieces.chain_log_prob)
    assert np.array_equal(whole.accepted, pieces.accepted)
    assert np.array_equal(whole.random[0], pieces.random[0])
    assert whole.random[1:] == pieces.random[1:]


def test_global_random_state_is_neither_read_nor_changed(
    target: tuple[CollapsedDensity, Proposal],
) -> None:
    legacy = np.random.get_state(legacy=False)  # noqa: NPY002  # this is what must not matter
    first = advance(*target, _new(target, 5), 5)
    np.random.seed(99)  # noqa: NPY002
    second = advance(*target, _new(target, 5), 5)
    assert np.array_equal(first.chain, second.chain)
    np.random.set_state(legacy)  # noqa: NPY002


def test_streams_of_two_ensembles_differ(target: tuple[CollapsedDensity, Proposal]) -> None:
    first = advance(*target, _new(target, 5), 5)
    second = advance(*target, _new(target, 6), 5)
    assert not np.any(np.all(first.chain == second.chain, axis=(1, 2)))


def test_log_density_of_the_chain_is_that_of_its_points(
    target: tuple[CollapsedDensity, Proposal],
) -> None:
    ensemble = advance(*target, _new(target, 5), 5)
    again = target[0](ensemble.chain[-1])
    # from coordinates to points and back a few roundings of a hundred nats are lost
    assert again == pytest.approx(ensemble.chain_log_prob[-1], rel=1e-12)


def test_a_restart_keeps_the_place_and_the_stream(
    target: tuple[CollapsedDensity, Proposal],
) -> None:
    density, proposal = target
    ensemble = advance(density, proposal, _new(target, 5), 5)
    fresh = restart(ensemble, proposal, proposal)
    assert fresh.steps == 0
    assert not fresh.accepted.any()
    following = advance(density, proposal, ensemble, 3).chain[-3:]
    anew = advance(density, proposal, fresh, 3).chain
    assert anew == pytest.approx(following, rel=1e-9, abs=1e-9)


def test_a_restart_in_other_coordinates_keeps_the_points(
    target: tuple[CollapsedDensity, Proposal],
) -> None:
    density, proposal = target
    ensemble = advance(density, proposal, _new(target, 5), 5)
    draws = ensemble.chain.reshape(-1, ensemble.chain.shape[-1])
    other = Proposal(proposal.optima, fit_map(draws), 0.5)
    fresh = restart(ensemble, proposal, other)
    z, log_det = other.bend(fresh.coords)
    assert z == pytest.approx(ensemble.chain[-1], rel=1e-9, abs=1e-9)
    assert fresh.log_prob - log_det == pytest.approx(ensemble.chain_log_prob[-1], rel=1e-12)


@dataclasses.dataclass(frozen=True)
class _Normal:
    """A standard normal in place of a density of frames."""

    def __call__(self, z: Array) -> Array:
        return np.asarray(-0.5 * np.sum(z**2, axis=1))


def test_local_moves_leave_a_normal_law_as_it_is() -> None:
    """Its variance in nine dimensions, walked by local moves alone, within 4 standard errors.

    The mean square of a run of 32 walkers and 3,000 steps scatters by 0.7 % (six runs), that of two
    by 0.5 %. With emcee's snooker move in a tenth of the steps it is 0.965.
    """
    d = 9
    optima = Mixture(np.zeros((1, d)), np.eye(d)[None], np.ones(1))
    proposal = Proposal(optima, None, 0.0)
    density = cast(CollapsedDensity, _Normal())
    squares = []
    for key in range(2):
        start = np.random.default_rng(key).standard_normal((32, d))
        ensemble = new_ensemble(proposal, start, density(start), np.random.SeedSequence(key))
        squares.append(np.mean(advance(density, proposal, ensemble, 3_000).chain ** 2))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.02)
