"""Weak signals: a spine that Laplace shapes follow, and a wide tail that they miss."""

import dataclasses
import functools
from typing import Any

import numpy as np
import pytest

from benchmarks.answer_times import _case
from inference.posterior import fold
from inference.posterior.sampling.rounds import in_rounds
from inference.posterior.sampling.rounds_so_far import Rounds, Wanted
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import setting_out, starting, walking
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.stage import Starting, Tempering, Walking, Weighted
from inference.posterior.stages.starting import begin
from tests.posterior.stages.planted_rounds import plant_rounds

SEED = 0
# of the sampling: of eight seeds, two runs of rounds each, c0 is 0.72 to 1.06 as wide as here
# (docs/limits.md#far-tail), and the first is one of those that leave a part of the tail out
SAMPLED = 1
# of standard coordinates, by two runs of 4 ensembles that made 531 and 663 steps (seeds 11 and 12)
MEAN = np.array([0.3302, -0.0662, 0.0713, -0.2779, 0.0535])
SD = np.array([0.4555, 0.3724, 0.0645, 0.2634, 0.0458])
ESS = 7800


def _job(method: str = "auto") -> fold.Job:
    sensor, scene, simulation = _case("sine_wave", "object, crosstalk", 10.0, SEED)
    settings = SamplerSettings.model_validate({"seed": SAMPLED, "method": method})
    return fold.prepare(sensor, scene, simulation.frames, settings)


@functools.cache
def _started() -> Checkpoint:
    return begin(_job(), Starting())


@functools.cache
def _rounds(*_: Any) -> Rounds:
    stage = _started().stage
    assert isinstance(stage, Tempering)
    job = _job()
    populations = tuple(each.z for each in stage.populations if each is not None)
    wanted = Wanted(400, setting_out.SCOUTED_DRAWS, setting_out.TOLERATED)
    rng = np.random.default_rng(1)
    return in_rounds(job.density(), stage.proposal, populations, rng, wanted)


def _after(method: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    plant_rounds(monkeypatch, lambda *_: _rounds())
    job = _job(method)
    (task,) = fold.tasks(job, _started())
    return fold.merge(job, _started(), [fold.run(task)]).stage


def test_points_from_the_prior_are_where_rounds_begin() -> None:
    stage = _started().stage
    assert isinstance(stage, Tempering)
    assert stage.scouted
    assert stage.arrived


def test_ensembles_do_not_start_from_draws_that_leave_out_where_scouts_stood() -> None:
    """Planted fault: they did, stayed in the tail and called for populations."""
    sensor, scene, simulation = _case("pulsed", "object, crosstalk", 100.0, SEED)
    settings = SamplerSettings.model_validate({"seed": SEED, "method": "emcee"})
    stage = begin(fold.prepare(sensor, scene, simulation.frames, settings), Starting()).stage
    assert isinstance(stage, Tempering)
    assert stage.scouted


def test_rounds_follow_draws_that_fit_and_are_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted fault: ensembles walked, stayed in the tail, and called for populations."""
    monkeypatch.setattr(starting, "_enough", lambda *_: False)
    sensor, scene, simulation = _case("pulsed", "object, crosstalk", 1000.0, SEED)
    settings = SamplerSettings.model_validate({"seed": SEED, "method": "auto"})
    stage = begin(fold.prepare(sensor, scene, simulation.frames, settings), Starting()).stage
    assert isinstance(stage, Tempering)
    assert stage.scouted


def test_rounds_follow_where_known_ranges_have_errors_integrated_out() -> None:
    """Planted fault: forty such frames counted as too dear for rounds, and populations set out."""
    sensor, scene, simulation = _case("sine_wave", "object, crosstalk", 100.0, SEED)
    ends = np.array([True] + [False] * 38 + [True])
    frames = dataclasses.replace(
        simulation.frames,
        known_range_m=np.where(ends, simulation.range_m, np.nan),
        known_range_sd_m=np.where(ends, 0.002, np.nan),
    )
    settings = SamplerSettings.model_validate({"seed": SEED, "method": "auto"})
    job = fold.prepare(sensor, scene, frames, settings)
    assert job.scene.model_error.integrated
    stage = begin(job, Starting()).stage
    assert isinstance(stage, Tempering)
    assert stage.scouted


def test_rounds_that_begin_at_these_points_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two planted faults.

    Rounds gave up after the first, whose draws foresaw too many that count. From the scouts' last
    places alone they left out a tail of some thousandths, a third of a variance, without a sign.
    """
    stage = _after("auto", monkeypatch)
    assert isinstance(stage, Weighted)
    assert stage.verdict.converged
    draws = stage.draws
    mean = draws.weights @ draws.z
    error = np.sqrt(np.square(draws.weights) @ np.square(draws.z - mean))
    # six standard errors of five means
    assert (np.abs(mean - MEAN) < 6 * np.hypot(error, SD / np.sqrt(ESS))).all()
    squares = np.square(draws.z - mean)
    variance = draws.weights @ squares
    error = np.sqrt(np.square(draws.weights) @ np.square(squares - variance))
    # the tail holds a few percent: what variances err by is that of its weight, in both
    assert (np.abs(variance - SD**2) < 6 * error * np.sqrt(1 + draws.ess / ESS)).all()


def test_ensembles_start_from_their_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = _after("emcee", monkeypatch)
    assert isinstance(stage, Weighted)
    assert stage.outset is not None
    assert stage.draws is _rounds().draws
    # a mode that hardly any walker would begin in: they are where a long walk begins
    monkeypatch.setattr(setting_out, "are_told", lambda *_: False)
    stage = _after("emcee", monkeypatch)
    assert isinstance(stage, Walking)
    assert stage.weighted is _rounds().draws
    assert stage.start is None
    assert stage.adaptations > 0  # what jumps propose from was held to the draws
    # the first chunk is what the easiest posterior takes: 50 times of a little more than one step
    assert {task.steps for task in walking.tasks(_job("emcee"), stage)} == {90}


def test_rounds_that_cannot_be_trusted_call_for_populations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Rounds, "trusted", property(lambda _: False))
    stage = _after("auto", monkeypatch)
    assert isinstance(stage, Tempering)
    assert not stage.scouted
    assert stage.populations == (None,) * POPULATIONS
