"""Rounds that begin with a shape where crosstalk and a background are confounded."""

import dataclasses
import functools
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import hard_posteriors
from inference.density.collapsed import CollapsedDensity
from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.sampling.rounds_so_far import Rounds, Wanted
from inference.posterior.sampling.scouts import Scouts, send_scouts
from inference.posterior.sampling.shape import Shape
from inference.posterior.sampling.start import Optimum
from inference.posterior.sampling.transport import unbent_map
from inference.posterior.stages import looking, shaping, starting
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.shaping import begins_with_a_shape, from_shapes
from inference.posterior.stages.stage import Starting, Tempering, Weighted
from inference.posterior.stages.standing import stands
from simulator.scene import parse_scene
from tests.posterior.stages.confounded import CONFOUNDED, confounded
from tests.posterior.stages.planted_rounds import plant_rounds
from tests.posterior.test_archive import same

Array = NDArray[np.float64]

# of 8 means and 8 widths, at 6 standard errors of normal law: once in 3e7; of correlated draws with
# unequal weights effective sizes are themselves known to a third
_SIGMAS = 6.0 * 1.3


def _run(job: fold.Job) -> list[Checkpoint]:
    found = [fold.start(job)]
    while tasks := fold.tasks(job, found[-1]):
        found.append(fold.merge(job, found[-1], [fold.run(task) for task in tasks]))
    return found


@functools.cache
def _shaped() -> list[Checkpoint]:
    return _run(confounded())


def _begun() -> Checkpoint:
    return next(one for one in _shaped() if isinstance(one.stage, Tempering))


def _answer(job: fold.Job, checkpoint: Checkpoint) -> Posterior:
    return fold.summarise(job, checkpoint, 1.0, 1.0)


def test_rounds_begin_with_a_shape_and_answer() -> None:
    begun = _begun()
    assert isinstance(begun.stage, Tempering)
    assert begun.stage.shaped
    assert begun.integrated
    assert begun.exact is not None
    last = _shaped()[-1]
    assert isinstance(last.stage, Weighted)
    assert last.stage.verdict.converged
    assert last.integrated
    # small populations of the exact model took 100,000, and rounds behind them 20,000
    assert last.calls < 40_000


@pytest.mark.thorough
def test_they_come_to_what_populations_from_the_prior_lead_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Means and standard deviations of all unknowns."""
    for module in (looking, starting):
        monkeypatch.setattr(module, "begins_with_a_shape", lambda *_: False)
    slow = _run(confounded())[-1]
    assert slow.integrated
    found = []
    for each in (_shaped()[-1], slow):
        assert isinstance(each.stage, Weighted)
        draws = each.stage.draws
        mean = draws.weights @ draws.z
        sd = np.sqrt(draws.weights @ (draws.z - mean) ** 2)
        found.append((mean, sd, draws.worth))
    (mean, sd, worth), (other, there, size) = found
    error = np.sqrt(1.0 / worth + 1.0 / size)
    assert np.all(np.abs(mean - other) < _SIGMAS * error * there)
    assert np.all(np.abs(np.log(sd / there)) < _SIGMAS * error)


def test_there_is_an_answer_as_soon_as_shapes_have_followed() -> None:
    """Planted fault: an answer waited for six rounds of maps."""
    job = confounded()
    stage_of = {
        len(one.stage.rounds.pool.laws): one
        for one in _shaped()
        if isinstance(one.stage, Tempering) and one.stage.rounds is not None
    }
    early = [one for laws, one in sorted(stage_of.items()) if laws <= 13]
    standing = [one for one in early if stands(one.stage)]
    assert standing
    posterior = _answer(job, standing[0])
    assert posterior.drawn
    assert not posterior.verdict.converged
    final = _answer(job, _shaped()[-1])
    for name, row in posterior.parameters.items():
        whole = final.parameters[name]
        width = whole.q95 - whole.q05
        assert abs(row.mean - whole.mean) < width
        assert row.q95 - row.q05 < 2.0 * width


def test_rounds_that_fail_leave_the_exact_model_to_small_populations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    last = _shaped()[-1].stage
    assert isinstance(last, Weighted)

    def doubted(*arguments: Any) -> Rounds:
        return Rounds(arguments[1], last.draws, dissent=1.0, calls=1, tolerated=0.01)

    plant_rounds(monkeypatch, doubted)
    job, begun = confounded(), _begun()
    pieces = [fold.run(task) for task in fold.tasks(job, begun)]
    after = fold.merge(job, begun, pieces)
    assert isinstance(after.stage, Tempering)
    assert not after.integrated
    assert after.exact is None
    assert after.stage is begun.exact
    assert after.stage.early
    assert not after.stage.scouted
    assert after.stage.populations == (None,) * POPULATIONS


def test_what_scouts_know_is_what_rounds_are_held_to() -> None:
    """A place that they stood at, far from the shape and as dense: the draws are doubted."""
    job = confounded()
    density = job.density()
    start = _before_shapes(job)
    assert start.scouts is not None
    reached = from_shapes(job, density, start)
    assert reached is not None
    assert isinstance(reached.stage, Tempering)
    kept = [population for population in reached.stage.populations if population is not None]
    np.testing.assert_array_equal(kept[0].z, start.scouts.z)
    known = {row.tobytes() for row in start.scouts.hot}
    assert len(kept[1].z) == min(len(start.scouts.hot), 1000)
    assert all(row.tobytes() in known for row in kept[1].z)
    none = Scouts(start.scouts.z[:0], start.scouts.hot[:0])
    assert from_shapes(job, density, dataclasses.replace(start, scouts=none)) is None


@functools.cache
def _before_shapes(job: fold.Job) -> Starting:
    """Return what was looked for before a shape was."""
    before = [one for one in _run_until_begun(job) if isinstance(one.stage, Starting)]
    stage = before[-1].stage
    assert isinstance(stage, Starting)
    return stage


def _run_until_begun(job: fold.Job) -> list[Checkpoint]:
    found = [fold.start(job)]
    while isinstance(found[-1].stage, Starting):
        pieces = [fold.run(task) for task in fold.tasks(job, found[-1])]
        found.append(fold.merge(job, found[-1], pieces))
    return found


def test_where_noise_leads_the_exact_model_comes_first() -> None:
    job = confounded(snr=10.0)
    start = _before_shapes(job)
    assert start.scouts is not None
    assert from_shapes(job, job.density(), start) is None


class _Bump:
    """A log density that bends by so much in every direction."""

    def __init__(self, bends: list[float]) -> None:
        self.bends = np.array(bends)

    def __call__(self, z: Array) -> Array:
        return np.asarray(-0.5 * z**2 @ self.bends)


@pytest.mark.parametrize(
    ("bends", "lead"),
    [([1.0, 1.0, 200.0], False), ([1.0, 20.0, 200.0], True), ([-90.0, -20.0, 2.0], True)],
)
def test_errors_lead_where_most_directions_bend_much(bends: list[float], lead: bool) -> None:
    """Planted fault: a slope on which the exact model bends upwards counted as none."""
    straight = unbent_map(np.zeros(3), np.eye(3), None)
    shape = Shape(Optimum(np.zeros(3), 0.0, np.eye(3)), straight)
    assert shaping._errors_lead(cast("CollapsedDensity", _Bump(bends)), shape) == lead


def test_scouts_stop_on_their_way_and_go_on_where_noise_leads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Planted fault: the exact model was begun with scouts that had stopped."""
    job = confounded(snr=10.0)
    before = _before_shapes(job)
    sent: list[Scouts] = []

    def recorded(*arguments: Any) -> tuple[Scouts, int]:
        scouts, calls = send_scouts(*arguments)
        sent.append(scouts)
        return scouts, calls

    monkeypatch.setattr(starting, "send_scouts", recorded)
    fold.run(starting.StartTask(job, before))
    assert before.scouts is not None
    (whole,) = sent
    short = before.scouts
    assert np.log(short.z.std(axis=0)).mean() > np.log(whole.z.std(axis=0)).mean()
    # the same way as far as they went
    assert {row.tobytes() for row in short.hot} < {row.tobytes() for row in whole.hot}


def test_two_tops_that_matter_are_left_to_populations() -> None:
    job = confounded()
    start = _before_shapes(job)
    assert start.shapes
    (top, *_) = start.shapes
    # all but as high, with nothing between
    z, nearly = top.optimum.z + 3.0, top.optimum.log_density - 0.1
    other = dataclasses.replace(top.optimum, z=z, log_density=nearly)
    both = dataclasses.replace(start, shapes=(top, dataclasses.replace(top, optimum=other)))
    assert from_shapes(job, job.density(), both) is None
    assert from_shapes(job, job.density(), start) is not None


def test_a_place_behind_a_dip_is_apart() -> None:
    """Two bumps six standard deviations apart, and the slope of one of them."""

    def bumps(z: Array) -> Array:
        one, other = -0.5 * (z**2).sum(axis=1), -0.5 * ((z - 6.0) ** 2).sum(axis=1)
        return np.asarray(np.logaddexp(one, other))

    straight = unbent_map(np.zeros(2), np.eye(2), None)
    shape = Shape(Optimum(np.zeros(2), 0.0, np.eye(2)), straight)
    density = cast("CollapsedDensity", bumps)
    for z, apart in ((np.full(2, 6.0), True), (np.full(2, 2.0), False)):
        assert shaping._is_apart(density, shape, z, float(bumps(z[None])[0])) == apart


def test_shapes_are_climbed_to_side_by_side() -> None:
    job = confounded()
    first, second, third, *_ = _shaped()
    assert all(isinstance(one.stage, Starting) and not one.stage.shapes for one in (first, second))
    tasks = [fold.tasks(job, one) for one in (first, second, third)]
    assert [[_name(task) for task in each] for each in tasks] == [
        ["scouts", "fitted", "climbed"],
        ["shape"] * len(tasks[1]),
        ["start"],
    ]
    stage = third.stage
    assert isinstance(stage, Starting)
    assert stage.shapes
    (one, *_) = stage.shapes
    each = looking.Looked(Starting(shapes=(one,)), 0)
    assert looking.taken_in(Starting(), [each, each])[0].shapes == (one, one)
    stored = Checkpoint.from_bytes(third.to_bytes())
    assert same(stored, third)


def test_a_shape_is_climbed_to_from_each_of_the_best_with_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    job = confounded()
    start = _before_shapes(job)
    (best, *_) = start.shapes or ()
    low = Optimum(best.optimum.z + 0.5, np.inf, best.optimum.factor)
    begun: list[Array] = []

    def noted(*arguments: Any) -> None:
        begun.append(arguments[2])

    monkeypatch.setattr(shaping, "shape_at", noted)
    for rank in (0, 1):
        task = looking.ShapeTask(job, (low, best.optimum), rank)
        assert task.run().start.shapes == ()
    np.testing.assert_array_equal(begun, [best.optimum.z, low.z])


def _name(task: fold.Task) -> str:
    if isinstance(task, looking.LookTask):
        return task.way
    return "shape" if isinstance(task, looking.ShapeTask) else "start"


def test_only_scenes_with_a_background_begin_so() -> None:
    open_scene = confounded()
    assert begins_with_a_shape(open_scene, open_scene.density())
    terms = {"object": {}, "crosstalk": hard_posteriors.SCENES[CONFOUNDED]["crosstalk"]}
    bare = dataclasses.replace(open_scene, scene=parse_scene(terms))
    assert not begins_with_a_shape(bare, bare.density())


def test_an_exact_model_and_importance_alone_begin_as_before() -> None:
    job = confounded()
    assert begins_with_a_shape(job, job.density())
    exact = dataclasses.replace(job, scene=job.scene.model_copy(update={"discrepancy": 0.0}))
    assert not begins_with_a_shape(exact, exact.density())
    alone = confounded(method="importance")
    assert not begins_with_a_shape(alone, alone.density())


def test_the_search_before_a_shape_is_brief() -> None:
    job = confounded()
    brief, whole = (
        [
            task.brief
            for task in looking.looking(job, Starting(), scouts=scouts)
            if isinstance(task, looking.LookTask)
        ]
        for scouts in (True, False)
    )
    assert brief == [True] * 3
    assert whole == [False] * 2


def test_rounds_are_of_shapes_first_and_then_of_maps() -> None:
    stages = [one.stage for one in _shaped() if isinstance(one.stage, Tempering)]
    rounds = [stage.rounds for stage in stages if stage.rounds is not None]
    assert rounds[0].wanted.shapes == 4
    for each in rounds:
        laws = len(each.pool.laws)
        assert each.shaped == (laws < 4)
        assert laws <= 4 or (laws - 4) % 3 == 0
    assert Wanted(1, 1).shapes == 0
