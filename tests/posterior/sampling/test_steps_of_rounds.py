"""Rounds of importance draws that are put aside between two steps are the same to the last bit."""

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from inference.posterior import archive
from inference.posterior.sampling import next_laws
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.rounds import (
    STEP,
    first_draws,
    in_rounds,
    next_draws,
    taken_in,
)
from inference.posterior.sampling.rounds_so_far import Rounds, RoundsSoFar, Wanted
from tests.posterior.test_archive import same

LAPLACE = Mixture(np.zeros((1, 2)), np.diag([1.0, 0.7])[None], np.ones(1))
START = Proposal(LAPLACE, None, 0.5)
WANTED = Wanted(3000, 12_000)
CONSTANT = np.log(2 * np.pi * 0.7)


def _target(z: np.ndarray) -> np.ndarray:
    """A banana."""
    x, y = np.asarray(z).T
    return np.asarray(-0.5 * (x**2 + ((y - 0.3 * (x**2 - 1.0)) / 0.7) ** 2))


def _population(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(300)
    return np.column_stack([x, 0.3 * (x**2 - 1.0) + 0.7 * rng.standard_normal(300)])


POPULATIONS = (_population(1), _population(2))


class _Counted:
    """The target, which counts what it is asked for."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, z: np.ndarray) -> np.ndarray:
        self.calls += len(z)
        return _target(z)


@pytest.fixture(autouse=True)
def straight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(next_laws, "coordinates_of", lambda _: None)


def _rng(steps: int) -> np.random.Generator:
    return np.random.default_rng([4, steps])


def _begun(target: Any = _target) -> RoundsSoFar:
    drawn = first_draws(target, START, POPULATIONS, _rng(0), WANTED)
    found = taken_in(drawn, target(drawn.open))
    assert isinstance(found, RoundsSoFar)
    return found


def _next(so_far: RoundsSoFar, target: Any = _target) -> RoundsSoFar | Rounds:
    drawn = next_draws(target, so_far, _rng(so_far.steps))
    return taken_in(drawn, target(drawn.open))


def _packed(so_far: RoundsSoFar) -> tuple[Any, archive.Arrays]:
    arrays: archive.Arrays = {}
    return archive.pack_parts(so_far, "rounds", arrays), arrays


def _all_steps() -> tuple[list[RoundsSoFar], Rounds]:
    found, reached = [], cast(RoundsSoFar | Rounds, _begun())
    while isinstance(reached, RoundsSoFar):
        found.append(reached)
        reached = _next(reached)
    return found, reached


def test_read_again_between_any_two_steps_they_come_to_the_same() -> None:
    """A store is given what a step adds, and reads all of it from what it was given."""
    steps, ended = _all_steps()
    assert ended.trusted
    assert any(one.last is not None and one.last.drawn is not None for one in steps)
    kept: list[bytes] = []
    before: archive.Arrays = {}
    for so_far, after in zip(steps, [*steps[1:], ended], strict=True):
        described, arrays = _packed(so_far)
        whole = archive.pack({"rounds": described}, arrays)
        added = archive.pack_addition({"rounds": described}, arrays, before) if before else None
        kept = [whole] if added is None else [*kept, added]
        if so_far.steps > 4 and added is not None:
            assert len(added) < 0.7 * len(whole)
        before = arrays
        meta, read = archive.unpack(*kept)
        again = archive.unpack_parts(meta["rounds"], read)
        assert same(again, so_far)
        reached = _next(again)
        if isinstance(after, Rounds):
            assert isinstance(reached, Rounds)
            assert np.array_equal(reached.draws.z, after.draws.z)
            assert np.array_equal(reached.draws.weights, after.draws.weights)
            assert (reached.calls, reached.dissent) == (after.calls, after.dissent)
            assert len(reached.proposal.more) == len(after.proposal.more)
        else:
            assert same(reached, after)
    assert len(kept) > 1


def test_a_step_takes_few_evaluations_and_all_are_counted() -> None:
    target = _Counted()
    reached: RoundsSoFar | Rounds = _begun(target)
    assert reached.calls == target.calls == 600 + 1000
    while isinstance(reached, RoundsSoFar):
        before, reached = reached.calls, _next(reached, target)
        assert 0 < reached.calls - before <= STEP
        assert reached.calls == target.calls
    # the draws that count are more than those of one step
    assert len(reached.draws.z) > 2 * STEP


def test_in_one_go_rounds_make_the_same_steps() -> None:
    """With one source of randomness for all steps."""
    rng, target = np.random.default_rng(4), cast(Any, _target)
    drawn = first_draws(target, START, POPULATIONS, rng, WANTED)
    reached = taken_in(drawn, _target(drawn.open))
    while isinstance(reached, RoundsSoFar):
        assert reached.open.size == 0
        drawn = next_draws(target, reached, rng)
        assert 0 < len(drawn.open) <= STEP
        reached = taken_in(drawn, _target(drawn.open))
    rng = np.random.default_rng(4)
    found = in_rounds(target, START, POPULATIONS, rng, WANTED)
    assert np.array_equal(found.draws.z, reached.draws.z)
    assert np.array_equal(found.draws.weights, reached.draws.weights)


def test_draws_of_rounds_that_go_on_are_those_of_the_target() -> None:
    steps, _ = _all_steps()
    told = [one for one in steps if one.telling]
    assert 0 < len(told) < len(steps)
    assert all(one.draws is None for one in steps if not one.telling)
    for one in told:
        draws = one.draws
        assert draws is not None
        made = 0 if one.last is None or one.last.drawn is None else len(one.last.drawn.z)
        assert len(draws.z) <= len(one.pool.z) - 600 + made
        assert len(draws.z) > 0.9 * (len(one.pool.z) - 600 + made)
        # five standard errors
        mean, square = draws.weights @ draws.z, draws.weights @ draws.z**2
        assert np.abs(mean).max() < 5 / np.sqrt(draws.worth)
        assert np.abs(square - [1.0, 0.49 + 0.18]).max() < 5 * 2 / np.sqrt(draws.worth)
        assert abs(draws.log_evidence - CONSTANT) < 5 / np.sqrt(draws.ess)


def test_draws_that_members_contradict_are_none() -> None:
    """Of one population's members as many lie where no law draws as are tolerated."""
    told = next(one for one in _all_steps()[0] if one.telling)
    pool = told.pool
    missed = int(WANTED.tolerated * 300)
    for count, stands in ((missed - 1, True), (missed, False)):
        target = pool.target.copy()
        target[:600] -= 30.0
        target[300 : 300 + count] += 60.0
        contradicted = dataclasses.replace(told, pool=dataclasses.replace(pool, target=target))
        assert (contradicted.draws is not None) == stands


def test_very_even_weights_tell_sooner_where_members_are_near() -> None:
    """A round has three laws, and the first step one."""
    told = {}
    for near in (False, True):
        for rounds in (3, 4, 7):
            for k_hat in (0.1, 0.3):
                pool: Any = SimpleNamespace(laws=(START,) * (1 + 3 * (rounds - 1)))
                wanted = dataclasses.replace(WANTED, near=near)
                so_far = RoundsSoFar(wanted, START, pool, (0,), 0)
                so_far.__dict__["k_hat"] = k_hat  # of weights that are not made
                told[near, rounds, k_hat] = so_far.telling
    assert {key for key, tells in told.items() if tells} == {
        *((near, 7, k_hat) for near in (False, True) for k_hat in (0.1, 0.3)),
        (True, 4, 0.1),
    }
