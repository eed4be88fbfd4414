"""Ensembles that walk from weighted draws that could be the answer: what `emcee` asks for."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np
import pytest

from inference.posterior import fold
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import walking
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import are_told, from_draws
from inference.posterior.stages.stage import Outset, Starting, Walking, Weighted
from inference.posterior.stages.starting import begin
from inference.posterior.stages.walking_on import WalkOnTask
from tests.posterior.scenes import example


@functools.cache
def _job(method: str = "emcee") -> fold.Job:
    settings = SamplerSettings.model_validate({"method": method, "seed": 4})
    return fold.prepare(*example("pulsed", crosstalk=True), settings)


@functools.cache
def _drawn() -> Weighted:
    stage = begin(_job(), Starting()).stage
    assert isinstance(stage, Weighted)
    return stage


def _outset() -> Outset:
    outset = _drawn().outset
    assert outset is not None
    return outset


@functools.cache
def _walking() -> Walking:
    return from_draws(_job(), _job().density(), _drawn().draws, _outset())[0]


def _ended(job: fold.Job, checkpoint: Checkpoint) -> Checkpoint:
    while pieces := [fold.run(task) for task in fold.tasks(job, checkpoint)]:
        checkpoint = fold.merge(job, checkpoint, pieces)
    return checkpoint


def test_walkers_end_where_the_draws_are() -> None:
    """Each mean within six of both Monte Carlo errors: 5 of them, a false alarm once in 1e7."""
    walked = fold.summarise(_job(), _ended(_job(), fold.start(_job())), 0.0, 0.0)
    auto = _job("auto")
    weighted = fold.summarise(auto, _ended(auto, fold.start(auto)), 0.0, 0.0)
    assert (walked.method, weighted.method) == ("emcee", "importance")
    assert walked.verdict.converged, walked.verdict.reasons
    for name, row in walked.parameters.items():
        other = weighted.parameters[name]
        assert abs(row.mean - other.mean) < 6 * math.hypot(row.mcse_mean, other.mcse_mean)
        assert row.sd == pytest.approx(other.sd, rel=6 / math.sqrt(row.ess_bulk))
        assert row.rhat is not None
        assert row.rhat < 1.01
        assert row.ess_bulk >= 400


def test_response_to_errors_is_looked_at_before_any_walks() -> None:
    checkpoint = begin(_job(), Starting())
    assert checkpoint.linear  # by the draws of a warm start; or in a step of its own
    (task,) = fold.tasks(_job(), dataclasses.replace(checkpoint, linear=False))
    assert not isinstance(task, WalkOnTask)
    assert fold.merge(_job(), checkpoint, [fold.run(task)]).linear
    (task,) = fold.tasks(_job(), checkpoint)
    assert isinstance(task, WalkOnTask)
    checkpoint = fold.merge(_job(), checkpoint, [fold.run(task)])
    assert isinstance(checkpoint.stage, Walking)
    assert checkpoint.linear  # and is not looked at again, when they have walked
    assert all(isinstance(task, walking.WalkTask) for task in fold.tasks(_job(), checkpoint))
    assert not any(isinstance(task, WalkOnTask) for task in fold.tasks(_job("auto"), checkpoint))


def test_as_many_walkers_begin_at_a_draw_as_its_weight_says() -> None:
    stage, draws = _walking(), _drawn().draws
    began = np.concatenate([stage.proposal.bend(e.coords)[0] for e in stage.ensembles[:-1]])
    near = np.abs(began[:, None] - draws.z).max(axis=2).argmin(axis=1)
    assert np.abs(began - draws.z[near]).max() < 1e-8
    counts = np.bincount(near, minlength=len(draws.z))
    assert np.abs(counts - len(began) * draws.weights / draws.weights.sum()).max() < 1.0
    assert stage.start == draws.worth


def test_the_last_ensemble_begins_elsewhere_and_forgets_the_way() -> None:
    """Points where next to nothing is, which a stretch of twelve steps leaves."""
    density, draws = _job().density(), _drawn().draws
    rng = np.random.default_rng(2)
    far = draws.z[:64] + 0.5 * rng.standard_normal((64, draws.z.shape[1]))
    far = far[np.isfinite(density(far))]
    least = draws.log_density.max() - 50.0
    assert np.median(density(far)) < least
    stage, calls = from_draws(_job(), density, draws, dataclasses.replace(_outset(), others=far))
    last = stage.ensembles[-1]
    assert last.steps == 0
    assert last.accepted.sum() == 0
    assert calls == 13 * last.walkers
    assert density(stage.proposal.bend(last.coords)[0]).min() > least


def _two_modes(share: float) -> WeightedDraws:
    rng = np.random.default_rng(1)
    z = np.concatenate([rng.normal(0.0, 1.0, 1000), rng.normal(30.0, 1.0, 1000)])[:, None]
    weights = np.repeat([(1.0 - share) / 1000, share / 1000], 1000)
    return WeightedDraws(z, np.zeros(2000), weights, 0.1, 0.0)


@pytest.mark.parametrize(("share", "told"), [(0.3, True), (0.03, True), (0.01, False)])
def test_of_a_mode_with_few_walkers_too_little_would_be_told(share: float, told: bool) -> None:
    """Of 192 walkers that begin at draws four are to begin in each mode."""
    assert are_told(_job(), _two_modes(share)) is told
    assert are_told(_job("auto"), _two_modes(share))


def test_walkers_that_never_agree_go_on_as_if_from_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Then a length is asked, and what they propose from is fitted anew where they are slow."""
    monkeypatch.setattr(walking, "_SHORT_WALK", 10)
    stage, job = _walking(), _job()
    pieces = [task.run() for task in walking.tasks(job, stage)]
    after, _ = walking.merge(job, stage, pieces)
    assert isinstance(after, Walking)
    assert after.start is None
    assert not after.verdict.converged
    assert "autocorrelation times" in " ".join(after.verdict.reasons)
    assert after.adaptations == 0  # populations may be called for
    behind = dataclasses.replace(_outset(), adaptations=2)  # and behind populations not again
    assert from_draws(job, job.density(), _drawn().draws, behind)[0].adaptations == 2
    monkeypatch.undo()
    after, _ = walking.merge(job, stage, pieces)
    assert isinstance(after, Walking)
    assert after.start == stage.start
    assert after.verdict.converged, after.verdict.reasons


def _moved(stage: Walking, k: int, by: float) -> Any:
    """Return the ensembles after a chunk, one of them moved by some standard deviations."""
    job = _job()
    ensembles = [task.run() for task in walking.tasks(job, stage)]
    sd = ensembles[0].chain.std(axis=(0, 1))
    ensembles[k] = dataclasses.replace(ensembles[k], chain=ensembles[k].chain + by * sd)
    return walking.merge(job, stage, ensembles)[0]


@pytest.mark.parametrize("k", [0, 3])
def test_an_ensemble_that_came_to_another_place_is_noticed(k: int) -> None:
    """Planted fault: a shift by 0.6 standard deviations of one of the ensembles."""
    after = _moved(_walking(), k, 0.6)
    assert not after.verdict.converged
    assert "R-hat" in " ".join(after.verdict.reasons)
    assert after.start is not None
