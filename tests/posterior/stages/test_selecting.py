"""How optional terms are decided, chunk by chunk."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from inference.posterior import fold
from inference.posterior import job as jobs
from inference.posterior.selection.evidence import weigh
from inference.posterior.selection.models import Candidate
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.looking import LookTask, looking, taken_in
from inference.posterior.stages.selecting import AssessTask
from inference.posterior.stages.stage import Starting
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of
from tests.posterior.test_archive import same

QUICK = SamplerSettings(seed=7, target_ess=50)
OPTIONAL = {"values": UNKNOWN_CROSSTALK, "optional": True}


def of_scene(scene: dict[str, object], frames: int = 12) -> fold.Job:
    """Return a job about the light of an object and crosstalk."""
    sensor = sensor_of("pulsed")
    simulated = data(sensor, {"crosstalk": [0.002, 0.01]}, frames)
    return fold.prepare(sensor, parse_scene(scene), simulated.frames, QUICK)


def assessed(job: fold.Job) -> tuple[list[type], fold.Checkpoint, list[Candidate]]:
    """Go on until terms are decided; return what the tasks were, where that is, and the choices."""
    checkpoint, kinds = fold.start(job), []
    while True:
        tasks = fold.tasks(job, checkpoint)
        kinds.append(type(tasks[0]))
        pieces = [fold.run(task) for task in tasks]
        checkpoint = fold.merge(job, checkpoint, pieces)
        candidates = [piece for piece in pieces if isinstance(piece, Candidate)]
        if candidates:
            return kinds, checkpoint, candidates


def test_a_posterior_with_optional_terms_starts_in_chunks_and_none_twice() -> None:
    job = of_scene({"crosstalk": OPTIONAL})
    kinds, reached, _ = assessed(job)
    assert kinds == [LookTask, AssessTask]
    stated = of_scene({"crosstalk": UNKNOWN_CROSSTALK})
    start = fold.start(stated)
    pieces = [fold.run(task) for task in fold.tasks(stated, start)]
    begun = fold.merge(stated, start, pieces).stage
    assert isinstance(reached.stage, Starting)
    assert isinstance(begun, Starting)
    assert same(reached.stage, dataclasses.replace(begun, scouts=None))
    (task,) = fold.tasks(job, reached)  # optima are not looked for again
    assert isinstance(task, LookTask)
    assert task.way == "scouts"


def test_ways_that_look_at_once_know_nothing_of_one_another() -> None:
    """In whatever order, and in however many chunks, they lead to the same start."""
    job = of_scene({"crosstalk": UNKNOWN_CROSSTALK})
    tasks = looking(job, Starting(), scouts=True)
    ways = [task.way for task in tasks if isinstance(task, LookTask)]
    assert ways == ["scouts", "fitted", "climbed"]  # the longest first
    found = [task.run() for task in tasks]
    start, calls = taken_in(Starting(), found)
    assert start.scouts is not None
    assert calls == found[0].calls > len(start.scouts.z)
    assert looking(job, start, scouts=True) == ()
    by_turns = Starting()
    for each in reversed(found):
        by_turns, _ = taken_in(by_turns, [each])
    assert same(by_turns, start)
    assert start.climbed is not None
    assert start.fitted is not None
    best = max((*start.climbed, *start.fitted), key=lambda one: one.log_density)
    assert start.optima[0] is best
    assert all(a.is_near(a.z) and not a.is_near(b.z) for a, b in itertools.pairwise(start.optima))
    # whichever way met it, and the best first
    far = dataclasses.replace(best, z=best.z + 30.0 * best.factor.sum(axis=1), log_density=1e6)
    both = dataclasses.replace(start, climbed=(best,), fitted=(far, best)).optima
    assert both == [far, best]
    assert dataclasses.replace(start, climbed=(far, best), fitted=(best,)).optima == both


def test_a_choice_that_leaves_nothing_unknown_has_nothing_to_be_looked_for() -> None:
    job = of_scene({"object": OBJECT, "crosstalk": OPTIONAL})
    assert len(fold.tasks(job, fold.start(job))) == 2  # of the other choice
    _, reached, (without, with_it) = assessed(job)
    assert without.terms == ()
    assert without.log_evidence < with_it.log_evidence - 100
    assert reached.selection is not None
    assert reached.selection.chosen == ("crosstalk",)


def test_optima_of_some_of_many_frames_serve_the_evidence_of_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    job = of_scene({"object": OBJECT, "crosstalk": OPTIONAL}, 80)
    known = of_scene({"object": OBJECT, "crosstalk": UNKNOWN_CROSSTALK}, 80)
    whole = weigh(known.density(), np.random.default_rng(8)).evidence
    monkeypatch.setattr(jobs, "MOST_SAMPLED", 70)
    monkeypatch.setattr("inference.posterior.stages.looking._SOME", (60, 10))
    assert job.is_large
    _, _, (_, found) = assessed(job)
    # two estimates of one integral: 5 standard errors, one alarm in 1.7 million
    error = math.hypot(whole.error, found.log_evidence_error)
    assert abs(whole.log_evidence - found.log_evidence) < 5 * error
