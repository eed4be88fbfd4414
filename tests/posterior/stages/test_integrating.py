"""Rounds with errors of the model integrated out from the start: an object before a known wall.

The exact model's posterior is thin and bent, and its Laplace shapes do not fit it. Where a shape
with errors integrated out is no beginning either, draws that follow these errors are.
"""

import dataclasses
import functools
import math

import numpy as np
import pytest

from benchmarks import hard_posteriors
from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import looking, starting
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.integrating import AtOnce
from inference.posterior.stages.responding import RespondTask, decided
from inference.posterior.stages.stage import Starting, Tempering, Weighted
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory
from tests.posterior.test_archive import same

READ, FRAMES = 1e-4, 40
BEYOND = 5.0  # standard errors: a false alarm in 1.7 million


@functools.cache
def _job(name: str = "background, R known", seed: int = 0) -> fold.Job:
    terms = hard_posteriors.SCENES[name]
    sensor = parse_sensor({**hard_posteriors.SENSORS["pulsed"], "noise": {"read": [READ, READ]}})
    truth = {term: hard_posteriors.TRUTH[term] for term in ("object", *terms)}
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=FRAMES, spacing="log")
    made = simulate(sensor, parse_scene({**truth, "discrepancy": 0}), path, 3)
    settings = SamplerSettings(method="auto", seed=seed)
    return fold.prepare(sensor, parse_scene(terms), made.frames, settings)


def _next(job: fold.Job, checkpoint: Checkpoint) -> Checkpoint:
    return fold.merge(job, checkpoint, [fold.run(task) for task in fold.tasks(job, checkpoint)])


def _begun(job: fold.Job) -> Checkpoint:
    """What the search for optima led to, without a shape."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (looking, starting):
            patch.setattr(module, "begins_with_a_shape", lambda *_: False)
        checkpoint = fold.start(job)
        while isinstance(checkpoint.stage, Starting):
            checkpoint = _next(job, checkpoint)
        return checkpoint


@functools.cache
def _steps() -> tuple[Checkpoint, ...]:
    """Every checkpoint from there on."""
    found = [_begun(_job())]
    while fold.tasks(_job(), found[-1]):
        found.append(_next(_job(), found[-1]))
    return tuple(found)


def test_rounds_begin_with_the_errors_integrated_out() -> None:
    begun, last = _steps()[0], _steps()[-1]
    assert begun.integrated
    assert isinstance(begun.stage, Tempering)
    assert isinstance(begun.exact, Tempering)
    assert begun.exact.rounds is None  # nothing was drawn of the exact model
    _, *scouts = (each for each in begun.stage.populations if each is not None)
    # points that came from the prior can contradict what the moved draws leave out
    assert [len(each.z) > 10 for each in scouts] == [True, True]
    assert isinstance(last.stage, Weighted)
    assert last.integrated
    assert last.exact is None
    assert not any(
        isinstance(task, RespondTask) for each in _steps() for task in fold.tasks(_job(), each)
    )


def test_what_it_stores_goes_on_to_the_same_end() -> None:
    stored = Checkpoint.from_bytes(_steps()[0].to_bytes())
    assert same(_next(_job(), stored), _steps()[1])


def test_rounds_answer_as_soon_as_they_tell() -> None:
    """Before, what the exact model knows is no answer: nothing was sampled of it."""
    drawn = [fold.summarise(_job(), _steps()[k], 1.0, 1.0) for k in (0, -2)]
    assert not drawn[0].drawn
    assert drawn[-1].drawn
    assert not drawn[-1].verdict.converged
    last = fold.summarise(_job(), _steps()[-1], 1.0, 1.0)
    assert last.verdict.converged
    # not standard deviations: the tail of c0 is so heavy that few draws hold most of its variance
    for path, row in last.parameters.items():
        early = drawn[-1].parameters[path]
        assert early.q95 - early.q05 == pytest.approx(row.q95 - row.q05, rel=0.3), path


def test_where_rounds_fail_the_exact_model_is_sampled_and_looked_at() -> None:
    begun = _steps()[0]
    stage = begun.stage
    assert isinstance(stage, Tempering)
    failed = dataclasses.replace(stage, populations=(None,), scouted=False)
    left = decided(dataclasses.replace(begun, stage=failed))
    assert left.stage is begun.exact
    assert not left.integrated
    assert left.exact is None
    assert not left.linear  # its response is still to be looked at, around draws of it
    assert fold.tasks(_job(), left)


@pytest.mark.thorough
def test_it_is_the_law_that_rounds_behind_an_exact_model_come_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(starting, "at_once", lambda *_: AtOnce(None, None, 0))
    job = _job(seed=1)
    checkpoint = _begun(job)
    assert not checkpoint.integrated
    while fold.tasks(job, checkpoint):
        checkpoint = _next(job, checkpoint)
    assert checkpoint.integrated
    _are_one_law(job, checkpoint)


def test_it_is_the_law_that_a_shape_leads_to() -> None:
    """Of the same readings; with a shape there are fewer evaluations."""
    job = _job(seed=2)
    found = [fold.start(job)]
    while fold.tasks(job, found[-1]):
        found.append(_next(job, found[-1]))
    assert any(isinstance(each.stage, Tempering) and each.stage.shaped for each in found)
    assert found[-1].calls < _steps()[-1].calls
    _are_one_law(job, found[-1])


def _are_one_law(job: fold.Job, checkpoint: Checkpoint) -> None:
    """Assert that an end has the means of `_steps`, within Monte Carlo errors.

    Of the unknowns where their priors are standard normal, and of the ranges that are best for
    them: what noise leaves of ranges beside is drawn the same way in both.
    """
    means, widths, sizes = [], [], []
    for of, each in ((_job(), _steps()[-1]), (job, checkpoint)):
        assert isinstance(each.stage, Weighted)
        draws, density = each.stage.draws, of.with_error_integrated().density()
        values = np.concatenate([draws.z, density.best_ranges(draws.z)[:, :, 0]], axis=1)
        means.append(draws.weights @ values)
        widths.append(np.sqrt(draws.weights @ (values - means[-1]) ** 2))
        sizes.append(draws.worth)
    standard_error = math.sqrt(1 / sizes[0] + 1 / sizes[1])
    assert np.all(np.abs(means[0] - means[1]) < BEYOND * standard_error * np.maximum(*widths))
