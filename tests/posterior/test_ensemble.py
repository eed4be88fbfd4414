"""Ensembles: reproducible, resumable, each with a random stream of its own."""

import numpy as np
import pytest

from inference.posterior.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.ensemble import Ensemble, advance, forget, new_ensemble
from inference.posterior.proposal import Mixture, mixture_of
from inference.posterior.start import find_optima
from tests.posterior.scenes import example


@pytest.fixture(scope="module")
def target() -> tuple[CollapsedDensity, Mixture]:
    density = collapsed_density(*example("pulsed", crosstalk=True))
    return density, mixture_of(find_optima(density, np.random.default_rng(1)))


def _new(target: tuple[CollapsedDensity, Mixture], key: int) -> Ensemble:
    density, mixture = target
    coords = mixture.draw(np.random.default_rng(3), 32)
    return new_ensemble(coords, density(coords), np.random.SeedSequence(key))


def test_chunks_do_not_change_the_chain(target: tuple[CollapsedDensity, Mixture]) -> None:
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
    target: tuple[CollapsedDensity, Mixture],
) -> None:
    legacy = np.random.get_state(legacy=False)  # noqa: NPY002  # this is what must not matter
    first = advance(*target, _new(target, 5), 5)
    np.random.seed(99)  # noqa: NPY002
    second = advance(*target, _new(target, 5), 5)
    assert np.array_equal(first.chain, second.chain)
    np.random.set_state(legacy)  # noqa: NPY002


def test_streams_of_two_ensembles_differ(target: tuple[CollapsedDensity, Mixture]) -> None:
    first = advance(*target, _new(target, 5), 5)
    second = advance(*target, _new(target, 6), 5)
    assert not np.any(np.all(first.chain == second.chain, axis=(1, 2)))


def test_log_density_of_the_chain_is_that_of_its_points(
    target: tuple[CollapsedDensity, Mixture],
) -> None:
    ensemble = advance(*target, _new(target, 5), 5)
    again = target[0](ensemble.chain[-1])
    assert np.array_equal(again, ensemble.chain_log_prob[-1])


def test_forgetting_keeps_the_place_and_the_stream(
    target: tuple[CollapsedDensity, Mixture],
) -> None:
    ensemble = advance(*target, _new(target, 5), 5)
    fresh = forget(ensemble)
    assert fresh.steps == 0
    assert not fresh.accepted.any()
    following = advance(*target, ensemble, 3).chain[-3:]
    assert np.array_equal(advance(*target, fresh, 3).chain, following)
