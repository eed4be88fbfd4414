"""Rounds of importance draws in chunks: the same in however many, and honest where time ends."""

import dataclasses
import functools
import itertools
from typing import Any

import pytest

from benchmarks.answer_times import _case
from inference.posterior import fold
from inference.posterior.sampling.rounds import STEP, next_draws
from inference.posterior.sampling.rounds_so_far import RoundsSoFar
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import setting_out, tempering
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.chunk import draws_of_rounds, evaluations, parts_of_a_step
from inference.posterior.stages.setting_out import Evaluated
from inference.posterior.stages.stage import Starting, Tempering, Weighted
from inference.posterior.stages.standing import standing
from inference.posterior.stages.starting import begin
from tests.posterior.test_archive import same

LIMIT = 60.0


@functools.cache
def _job() -> fold.Job:
    """Weak signals: rounds begin at the points from the prior."""
    sensor, scene, simulation = _case("sine_wave", "object, crosstalk", 10.0, 0)
    settings = SamplerSettings(seed=0, method="auto", max_seconds=LIMIT)
    return fold.prepare(sensor, scene, simulation.frames, settings)


@functools.cache
def _started() -> Checkpoint:
    return begin(_job(), Starting())


def _merged(checkpoint: Checkpoint) -> Checkpoint:
    (task,) = fold.tasks(_job(), checkpoint)
    return fold.merge(_job(), checkpoint, [fold.run(task)])


def _in_rounds(checkpoint: Checkpoint) -> bool:
    return isinstance(checkpoint.stage, Tempering)


def _chunks(stored: bool) -> list[Checkpoint]:
    """Return all checkpoints from where rounds begin to where they end."""
    found = [_started()]
    while _in_rounds(found[-1]):
        last = Checkpoint.from_bytes(found[-1].to_bytes()) if stored else found[-1]
        found.append(_merged(last))
    return found


@functools.cache
def _steps() -> tuple[Checkpoint, ...]:
    """The same with a step a chunk, each stored and read again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempering, "draws_of_rounds", lambda _: 1)
        patch.setattr(tempering, "parts_of_a_step", lambda _: 1)  # whichever test asks first
        return tuple(_chunks(stored=True))


def test_in_one_chunk_or_in_many_that_are_stored_rounds_come_to_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tempering, "draws_of_rounds", lambda _: 1_000_000)
    _, whole = _chunks(stored=False)
    chunks = _steps()
    assert len(chunks) > 8  # a step each
    assert isinstance(whole.stage, Weighted)
    assert same(chunks[-1], whole)


def test_a_chunk_of_rounds_is_bounded_by_its_evaluations() -> None:
    most, chunks = draws_of_rounds(_job()), _chunks(stored=False)
    assert STEP < most < evaluations(_job())
    taken = [after.calls - before.calls for before, after in itertools.pairwise(chunks)]
    assert len(taken) > 2
    assert all(most <= one < most + STEP for one in taken[1:-1])
    assert 0 < taken[-1] < most + STEP
    stage = _started().stage
    assert isinstance(stage, Tempering)
    members = sum(len(each.z) for each in stage.populations if each is not None)
    assert most <= taken[0] < most + STEP + members


def test_every_step_has_a_stream_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted fault: of one stream for all steps, every round drew the same normal numbers."""
    states: list[str] = []

    def noted(*arguments: Any) -> RoundsSoFar:
        states.append(str(arguments[2].bit_generator.state))
        return next_draws(*arguments)

    monkeypatch.setattr(setting_out, "next_draws", noted)
    stage = _merged(_merged(_started())).stage
    assert isinstance(stage, Tempering)
    begun_again = dataclasses.replace(_started(), stage=dataclasses.replace(stage, rounds=None))
    assert len(set(states)) == len(states) > 2
    first = list(states)
    _merged(begun_again)
    assert set(states[len(first) :]) <= set(first)  # and the same one whenever it is made
    tried = dataclasses.replace(stage, rounds=None, scouted=False, reach=0.3)
    for once in (False, True):
        before = len(states)
        _merged(dataclasses.replace(begun_again, stage=dataclasses.replace(tried, tried=once)))
        assert len(states) > before
        assert not set(states[before:]) & set(states[:before])


def test_one_step_is_made_however_short_a_chunk_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempering, "draws_of_rounds", lambda _: 0)
    stage = _merged(_merged(_started())).stage
    assert isinstance(stage, Tempering)
    assert stage.rounds is not None
    assert stage.rounds.steps == 2


def test_out_of_time_draws_of_rounds_answer_and_say_so() -> None:
    checkpoint = next(
        each
        for each in _steps()
        if isinstance(each.stage, Tempering) and each.stage.rounds and each.stage.rounds.telling
    )
    assert fold.tasks(_job(), checkpoint, LIMIT) == ()
    assert not fold.progress(_job(), checkpoint).finished
    found = fold.summarise(_job(), checkpoint, LIMIT, LIMIT)
    assert found.drawn
    assert found.method == "importance"
    assert not found.verdict.converged
    assert found.verdict.reasons[0] == f"stopped at the time limit of {LIMIT:g} s"
    assert "rounds that were not ended" in found.verdict.reasons[1]
    assert all(row.status != "identified" for row in found.identifiability)
    # nor is it an answer without a limit
    assert not fold.summarise(_job(), checkpoint, 0.0, 0.0).verdict.converged


def test_after_few_rounds_their_draws_do_not_answer() -> None:
    """Planted fault: after two rounds even weights (k-hat 0.3, an effective size of 260) held a
    tenth of an unknown's standard deviation, in a random set."""
    stage = _steps()[3].stage
    assert isinstance(stage, Tempering)
    assert stage.rounds is not None
    assert stage.rounds.draws is None
    reasons = standing(stage).verdict.reasons
    assert not any("rounds" in reason for reason in reasons)


def test_draws_of_costly_steps_are_evaluated_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same rounds to the last bit, whoever evaluates which part; and all are counted."""
    monkeypatch.setattr(tempering, "parts_of_a_step", lambda _: 3)
    reached, before = [_started()], 0
    while _in_rounds(reached[-1]):
        tasks = fold.tasks(_job(), reached[-1])
        assert len(tasks) == 3
        pieces = [fold.run(task) for task in tasks]
        values = [piece.values for piece in pieces if isinstance(piece, Evaluated)]
        reached.append(fold.merge(_job(), Checkpoint.from_bytes(reached[-1].to_bytes()), pieces))
        assert max(map(len, values)) - min(map(len, values)) <= 1
        calls, before = reached[-1].calls - before, reached[-1].calls
        if len(reached) > 2:
            assert calls == sum(map(len, values)) <= STEP
    assert same(tuple(reached), _steps())
    with pytest.raises(ValueError, match="first part"):
        fold.merge(_job(), _started(), pieces[1:])


def test_steps_are_dealt_out_where_their_evaluation_is_most_of_them() -> None:
    integrated = _job().with_error_integrated()
    assert parts_of_a_step(_job()) == 1
    assert parts_of_a_step(integrated) == 2
    stage = _started().stage
    assert isinstance(stage, Tempering)
    assert len(tempering.tasks(integrated, stage)) == 2
