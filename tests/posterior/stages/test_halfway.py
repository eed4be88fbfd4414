"""Small populations that stop on their way: where rounds of importance draws begin."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np
import pytest

from benchmarks.coverage.paths import draw_path
from inference.posterior import fold
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.rounds import in_rounds
from inference.posterior.sampling.rounds_so_far import Rounds, Wanted
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import setting_out, tempering
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.stage import Starting, Tempering, Walking, Weighted
from inference.posterior.stages.standing import best_known
from inference.posterior.stages.starting import begin
from simulator.scene import parse_scene
from tests.posterior.stages.planted_rounds import plant_rounds

SEED = 1


@functools.cache
def _job(method: str) -> fold.Job:
    """Crosstalk and a wall that both are unknown: the readings tell their sum alone.

    The model is exact: rounds with its errors begin with a shape.
    """
    data = draw_path("log-spaced", "both", "nothing", SEED)
    settings = SamplerSettings.model_validate({"seed": SEED, "method": method})
    scene = parse_scene({**data.scene, "discrepancy": 0})
    return fold.prepare(data.sensor, scene, data.frames, settings)


@functools.cache
def _started() -> Checkpoint:
    return begin(_job("auto"), Starting())


@functools.cache
def _carried() -> Checkpoint:
    job, checkpoint = _job("auto"), _started()
    while isinstance(checkpoint.stage, Tempering) and not checkpoint.stage.arrived:
        parts = [fold.run(task) for task in fold.tasks(job, checkpoint)]
        checkpoint = fold.merge(job, checkpoint, parts)
    return checkpoint


def _after(method: str) -> Checkpoint:
    """Return what rounds lead to, in however many chunks."""
    return _led_to(_job(method), _carried())


def _led_to(job: fold.Job, checkpoint: Checkpoint) -> Checkpoint:
    while True:
        (task,) = fold.tasks(job, checkpoint)
        checkpoint = fold.merge(job, checkpoint, [fold.run(task)])
        if not (isinstance(checkpoint.stage, Tempering) and checkpoint.stage.rounds):
            return checkpoint


@pytest.mark.thorough
def test_where_light_is_confounded_small_populations_set_out() -> None:
    stage = _started().stage
    assert isinstance(stage, Tempering)
    assert stage.early
    assert not stage.scouted
    assert stage.populations == (None,) * POPULATIONS


@pytest.mark.thorough
def test_they_stop_on_their_way() -> None:
    stage = _carried().stage
    assert isinstance(stage, Tempering)
    for population in stage.populations:
        assert population is not None
        assert stage.reach <= population.power < 1.0
        assert len(population.z) == 288  # a third of what is carried all the way


def test_rounds_from_there_answer_at_a_fraction_of_the_cost() -> None:
    """Planted fault: populations of 864, carried all the way, took 155,000 evaluations alone."""
    found = _after("auto")
    assert isinstance(found.stage, Weighted)
    assert found.stage.verdict.converged
    assert found.calls < 60_000  # 35,000 with this seed


def test_ensembles_start_from_their_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = _after("emcee").stage
    assert isinstance(stage, Weighted)
    assert stage.outset is not None
    assert stage.outset.adaptations == 2
    # a mode that hardly any walker would begin in: they are where a long walk begins
    monkeypatch.setattr(setting_out, "are_told", lambda *_: False)
    stage = _after("emcee").stage
    assert isinstance(stage, Walking)
    assert stage.weighted is not None
    assert stage.start is None
    assert stage.adaptations == 2


def test_where_rounds_fail_populations_are_carried_all_the_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def doubted(*arguments: Any) -> Rounds:
        wanted = dataclasses.replace(arguments[4], most=0)  # draws to spend
        none: Any = (*arguments[:4], wanted)
        return dataclasses.replace(in_rounds(*none), dissent=1.0)

    plant_rounds(monkeypatch, doubted)
    stage = _after("auto").stage
    assert isinstance(stage, Tempering)
    assert not stage.early
    assert stage.populations == (None,) * POPULATIONS
    carried = _carried().stage
    assert isinstance(carried, Tempering)
    known = best_known(carried)
    assert known is not None
    # what the small ones know stands until the larger ones are on their way
    assert stage.weighted is not None
    assert stage.weighted.ess == known[0].ess
    assert {getattr(task, "reach", None) for task in tempering.tasks(_job("auto"), stage)} == {1.0}


@functools.cache
def _drawn() -> Rounds:
    """Draws of rounds that had little to spend."""
    stage, job = _carried().stage, _job("auto")
    assert isinstance(stage, Tempering)
    populations = tuple(each.z for each in stage.populations if each is not None)
    rng = np.random.default_rng(SEED)
    wanted = Wanted(400, 12_000, 1.0, 0.0)
    return in_rounds(job.density(), stage.proposal, populations, rng, wanted)


def test_rounds_that_came_far_begin_again_where_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a chunk of their own, as a job may be out of time; and only once.

    Of twelve runs of six sets the first rounds failed in four; of the three of these that came far
    enough the second ones answered two.
    """
    given: list[tuple[np.ndarray, ...]] = []
    doubtful = dataclasses.replace(
        _drawn(), draws=dataclasses.replace(_drawn().draws, k_hat=0.9), dissent=0.0
    )

    def doubted(*arguments: Any) -> Rounds:
        given.append(arguments[2])
        return doubtful

    plant_rounds(monkeypatch, doubted)
    job, first = _job("auto"), _after("auto")
    assert isinstance(first.stage, Tempering)
    assert first.stage.early
    assert first.stage.tried
    assert first.stage.weighted is doubtful.draws  # what an answer is made of, were there no time
    assert first.calls == _carried().calls + doubtful.calls
    stored = Checkpoint.from_bytes(first.to_bytes())
    (task,) = fold.tasks(job, stored)
    assert isinstance(task, setting_out.SetOutTask)
    second = fold.merge(job, stored, [fold.run(task)])
    assert len(given[0]) == POPULATIONS
    *before, drawn = given[1]
    assert all(map(np.array_equal, before, given[0]))
    places = {row.tobytes() for row in doubtful.draws.z}
    assert all(row.tobytes() in places for row in drawn)
    assert isinstance(second.stage, Tempering)
    assert not second.stage.early
    assert second.stage.populations == (None,) * POPULATIONS


def test_rounds_that_came_nowhere_are_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    draws = _drawn().draws
    one = np.zeros(len(draws.weights))
    one[0] = 1.0
    poor = dataclasses.replace(draws, weights=one, k_hat=math.inf)
    found = dataclasses.replace(_drawn(), draws=poor, dissent=0.0)
    plant_rounds(monkeypatch, lambda *_: found)
    stage = _after("auto").stage
    assert isinstance(stage, Tempering)
    assert not stage.early


@pytest.mark.parametrize("method", ["auto", "emcee"])
def test_trusted_draws_that_are_too_few_call_for_larger_populations(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """When the second rounds are as poor: walkers would take many times as long."""
    draws = _drawn().draws
    some = np.zeros(len(draws.weights))
    some[np.argsort(draws.weights)[-200:]] = 1 / 200
    draws = dataclasses.replace(draws, weights=some, k_hat=0.1)
    few = dataclasses.replace(_drawn(), draws=draws, dissent=0.0)
    monkeypatch.setattr(Rounds, "trusted", property(lambda _: True))
    plant_rounds(monkeypatch, lambda *_: few)
    assert few.draws.ess < _job(method).settings.target_ess
    again = _after(method)
    assert isinstance(again.stage, Tempering)
    assert again.stage.tried
    (task,) = fold.tasks(_job(method), again)
    last = fold.merge(_job(method), again, [fold.run(task)]).stage
    assert isinstance(last, Tempering)
    assert last.populations == (None,) * POPULATIONS
    assert not last.early


def test_where_they_die_on_the_way_larger_ones_set_out() -> None:
    stage, d = _started().stage, 8
    assert isinstance(stage, Tempering)
    none = np.empty(0)
    dead = Population(np.empty((0, d)), none, none, 0.0, -math.inf, 0, 1152)
    after, calls = tempering.merge(_job("auto"), stage, [dead] * POPULATIONS)
    assert isinstance(after, Tempering)
    assert not after.early
    assert after.populations == (None,) * POPULATIONS
    assert calls == 1152 * POPULATIONS
