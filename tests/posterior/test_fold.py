"""The fold: the same answer in any number of pieces, in any place; refusals before any work."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.sampling.importance import WeightedDraws, draw_weighted
from inference.posterior.sampling.population import Population
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import starting
from inference.posterior.stages.stage import Starting, Tempering, Walking, Weighted
from inference.posterior.stages.starting import begin
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.scene import Scene, Stroke, parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, example, sensor_of

WIDE_HALF = {"prior": "halfnormal", "sd": 1.3}
QUICK = SamplerSettings(method="emcee", seed=7, target_ess=50, max_seconds=3600)


def same(a: Posterior, b: Posterior) -> bool:
    first, second = (p.to_json() | {"runtime": None} for p in (a, b))
    return first == second and np.array_equal(a.draws.parameters, b.draws.parameters)


def test_an_executor_changes_nothing() -> None:
    request = example("sine_wave", crosstalk=False)
    with ThreadPoolExecutor(2) as executor:
        assert same(infer(*request, QUICK), infer(*request, QUICK, executor))


def test_another_seed_gives_other_draws_and_no_seed_is_returned() -> None:
    request = example("pulsed", crosstalk=False)
    first = infer(*request, QUICK)
    second = infer(*request, QUICK.model_copy(update={"seed": 8}))
    # stopped at its first look
    drawn = infer(*request, QUICK.model_copy(update={"seed": None, "max_seconds": 1e-3}))
    assert first.seed == 7
    assert not np.array_equal(first.draws.parameters, second.draws.parameters)
    assert drawn.seed >= 0


def test_progress_ends_where_the_job_ends() -> None:
    job = fold.prepare(*example("pulsed", crosstalk=False), QUICK)
    checkpoint = fold.start(job)
    before = fold.progress(job, checkpoint)
    assert before.steps == 0
    assert not before.finished
    while pieces := [fold.run(task) for task in fold.tasks(job, checkpoint)]:
        checkpoint = fold.merge(job, checkpoint, pieces)
    after = fold.progress(job, checkpoint)
    assert after.finished
    assert after.ess is not None
    assert after.ess >= 50


def test_stopped_before_the_first_chunk_weighted_draws_are_the_answer() -> None:
    job = fold.prepare(*example("pulsed", crosstalk=False), QUICK)
    posterior = fold.summarise(job, fold.start(job), 0.0, 0.0)
    assert not posterior.verdict.converged
    assert posterior.drawn
    assert posterior.method == "importance"
    assert np.isfinite(posterior.range_m.q50).all()


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ({"motion": "tangential"}, "differential"),
    ],
)
def test_what_the_posterior_cannot_answer_is_refused_with_a_remedy(
    scene: dict[str, Any], words: str
) -> None:
    sensor, _, frames = example("pulsed", crosstalk=False)
    with pytest.raises(RefusedError, match=words):
        fold.prepare(sensor, parse_scene(scene), frames, QUICK)


def test_a_scene_that_breaks_a_rule_is_named_below_scene() -> None:
    sensor, _, frames = example("pulsed", crosstalk=False)
    with pytest.raises(InvalidInputError) as caught:
        fold.prepare(sensor, parse_scene({"object": {"c0": -1.0}}), frames, QUICK)
    assert caught.value.problems[0].pointer == "/scene/object/c0"


def test_all_frames_saturated_is_refused() -> None:
    _, scene, frames = example("pulsed", crosstalk=False)
    sensor = parse_sensor(
        {
            "kind": "pulsed",
            "pulse_width_s": 1e-7,
            "noise": {"read": [1e-6, 1e-6]},
            "full_scale": [1e-9, 1e-9],
        }
    )
    with pytest.raises(RefusedError, match="saturated"):
        fold.prepare(sensor, scene, frames, QUICK)


def test_a_saturated_frame_is_left_open_and_the_others_are_answered() -> None:
    plain = sensor_of("pulsed")
    frames = data(plain).frames
    limit = float(np.sort(frames.readings[:, 1])[-3])
    sensor = parse_sensor({**plain.model_dump(exclude_none=True), "full_scale": [limit, limit]})
    posterior = infer(sensor, parse_scene({}), frames, QUICK)
    saturated = frames.readings[:, 1] >= limit
    assert saturated.sum() == 3
    assert np.isnan(posterior.range_m.q50[saturated]).all()
    assert np.isfinite(posterior.range_m.q50[~saturated]).all()
    assert posterior.to_json()["range_m"]["q50"][int(np.flatnonzero(saturated)[0])] is None


def test_empty_frames_have_no_range_and_fix_the_crosstalk() -> None:
    sensor = sensor_of("pulsed")
    scene = parse_scene(
        {
            "object": OBJECT,
            "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.1}] * 2,
        }
    )
    rng = np.random.default_rng(5)
    readings = np.array([0.002, 0.01]) + 7.72e-6 * rng.standard_normal((9, 2))
    frames = Frames(readings, object_present=np.zeros(9, dtype=bool))
    posterior = infer(sensor, scene, frames, QUICK)
    assert np.isnan(posterior.range_m.q50).all()
    for name, column in (("crosstalk.w1", 0), ("crosstalk.w2", 1)):
        summary = posterior.parameters[name]
        # the mean of nine readings, known to a third of their noise
        assert summary.mean == pytest.approx(readings[:, column].mean(), abs=5 * summary.mcse_mean)
        assert summary.sd == pytest.approx(7.72e-6 / 3, rel=0.2)


def test_nothing_unknown_needs_no_sampling() -> None:
    sensor = sensor_of("pulsed")
    simulation = data(sensor)
    posterior = infer(sensor, parse_scene({"object": OBJECT}), simulation.frames, QUICK)
    assert posterior.verdict.converged
    assert posterior.parameters == {}
    error = np.abs(posterior.range_m.q50 - simulation.range_m) / posterior.range_m.sd
    # twenty normal variates: one beyond 5 has a probability of 1e-5
    assert error.max() < 5


def test_one_frame_is_answered_and_what_it_cannot_tell_is_marked() -> None:
    sensor, scene, frames = example("pulsed", crosstalk=True)
    # two numbers for six unknowns leave a thin sheet on which no ensemble gets far: the answer
    # need not converge, but must neither fail nor claim knowledge
    settings = QUICK.model_copy(update={"max_seconds": 4.0})
    posterior = infer(sensor, scene, frames.select(slice(0, 1)), settings)
    status = {row.parameter: row.status for row in posterior.identifiability}
    assert set(status) == {*posterior.parameters, "range_m"}
    assert "identified" not in {status["object.c0"], status["object.c1"], status["object.c2"]}
    assert status["range_m"] != "identified"


def test_readings_far_off_any_model_are_a_misfit_not_a_failure() -> None:
    sensor, _, frames = example("pulsed", crosstalk=False)
    wild = dataclasses.replace(frames, readings=frames.readings[::-1] * [1.0, -1.0])
    posterior = infer(sensor, parse_scene({"object": OBJECT}), wild, QUICK)
    assert posterior.fit.misfit
    assert posterior.to_json()["fit"]["misfit"] is True


def test_importance_is_refused_where_it_cannot_be_trusted() -> None:
    sensor = sensor_of("pulsed")
    wall = {"strength": 0.017, "distance_m": 3.0}
    truth = {"background": {**wall, "shadow": {"c0": 0.056, "c1": 0.02}}}
    frames = data(sensor, truth, 40, seed=0).frames
    settings = QUICK.model_copy(update={"method": "importance"})
    with pytest.raises(RefusedError, match="k-hat"):
        infer(sensor, parse_scene({"background": wall}), frames, settings)


@pytest.mark.parametrize("law", [{"prior": "lognormal", "median": 1.0, "sigma": 0.7}, WIDE_HALF])
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_a_law_of_the_ranges_may_have_no_end(kind: str, law: dict[str, Any]) -> None:
    """Some frames lie in its outer twentieth, where the prior's doing is looked into."""
    sensor = sensor_of(kind)
    frames = data(sensor, frames=8, span=(0.1, 2.9)).frames
    settings = SamplerSettings(method="importance", seed=1, target_ess=50)
    posterior = infer(sensor, parse_scene({"object": OBJECT, "range_m": law}), frames, settings)
    assert np.isfinite(posterior.range_m.mean).all()
    assert posterior.verdict.converged


def test_populations_that_die_are_not_called_for_again() -> None:
    """A background's prior lies before nearly all ranges: the map is fitted to the draws then."""
    sensor = sensor_of("pulsed")
    strength = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
    wall = {"strength": 0.017, "distance_m": 6.0, "shadow": {"c0": 0.056, "c1": 0.02}}
    near = {"prior": "lognormal", "median": 1.0, "sigma": 0.5}
    scene = {
        "range_m": {"prior": "uniform", "low": 3.2, "high": 4.4},
        "background": {"strength": strength, "distance_m": near},
    }
    frames = data(sensor, {"background": wall}, frames=6, span=(3.3, 4.2)).frames
    job = fold.prepare(sensor, parse_scene(scene), frames, SamplerSettings(seed=1, ensembles=2))
    checkpoint = begin(job, Starting())
    assert isinstance(checkpoint.stage, Tempering)
    populations = [fold.run(task) for task in fold.tasks(job, checkpoint)]
    assert all(isinstance(one, Population) and len(one.z) == 0 for one in populations)
    checkpoint = fold.merge(job, checkpoint, populations)
    checkpoint = fold.merge(job, checkpoint, [fold.run(t) for t in fold.tasks(job, checkpoint)])
    assert isinstance(checkpoint.stage, Walking)
    assert checkpoint.stage.proposal.transport is not None


def test_a_scene_made_in_python_is_stored_whole() -> None:
    """Members that were never stated, as the tag of a prior, belong to what is stored."""
    sensor, _, frames = example("pulsed", crosstalk=False)
    scene = Scene(range_m=Stroke(low=0.1, high=3.0))
    job = fold.prepare(sensor, scene, frames, SamplerSettings(seed=1))
    assert fold.Job.from_bytes(job.to_bytes()).scene == scene


def test_importance_sampling_is_bounded_whatever_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts: list[int] = []

    def counting(*arguments: Any) -> WeightedDraws:
        counts.append(arguments[-1])
        return draw_weighted(*arguments)

    monkeypatch.setattr(starting, "draw_weighted", counting)
    monkeypatch.setattr(starting, "_MOST_IMPORTANCE_FRAMES", 60_000)
    job = fold.prepare(
        *example("pulsed", crosstalk=False),
        SamplerSettings(seed=1, method="importance", target_ess=1_000_000),
    )
    stage = begin(job, Starting()).stage
    assert counts == [3000] * len(counts)
    assert isinstance(stage, Weighted)
    assert not stage.verdict.converged


def test_draws_of_a_job_that_was_stopped_before_its_terms_were_decided() -> None:
    """They are those of the answer: all terms kept, and none drawn yet."""
    sensor, _, frames = example("pulsed", crosstalk=True, frames=8)
    scene = parse_scene({"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}})
    job = fold.prepare(sensor, scene, frames, QUICK)
    checkpoint = fold.start(job)
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    whole, draws = fold.draw(job, checkpoint)
    assert whole.scene.crosstalk is not None
    assert draws.names == posterior.draws.names
    assert np.array_equal(draws.parameters, posterior.draws.parameters)
