"""A job that is stored and read again between any two chunks is the same to the last bit."""

from typing import Any

import numpy as np
import pytest

from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import chunk
from inference.posterior.stages.stage import (
    Selecting,
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from inference.posterior.stages.starting import begin
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of
from tests.posterior.test_archive import same

WALL = {"strength": 0.017, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.02}}
UNKNOWN_WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.5},
}
# truth beside the object, scene, method, frames, most chunks, stages
CASES: dict[str, tuple[dict[str, Any], dict[str, Any], str, int, int, tuple[type, ...]]] = {
    "optional term": (
        {},
        {"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}, "discrepancy": 0},
        "emcee",
        10,
        12,
        (Selecting, Starting, Weighted, Walking),
    ),
    "curved": (
        {"background": WALL},
        {"background": UNKNOWN_WALL},
        "emcee",
        3,
        60,
        (Starting, Tempering, Weighted, Walking),
    ),
    "weighted": (
        {"crosstalk": [0.002, 0.01]},
        {"crosstalk": UNKNOWN_CROSSTALK},
        "importance",
        20,
        5,
        (Starting, Weighted),
    ),
    "known": ({}, {"object": OBJECT}, "emcee", 20, 2, (Starting, Settled)),
}


# every stage of what is weighted alone is one of what is curved
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.thorough) if name == "weighted" else name
        for name in CASES
    ],
)
def test_in_every_stage(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # small chunks: many places to stop at
    monkeypatch.setattr(chunk, "_CHUNK_S", 0.1 if name == "curved" else 0.02)
    truth, scene, method, frames, most, stages = CASES[name]
    sensor = sensor_of("pulsed")
    simulated = data(sensor, truth, frames)
    # so much that walkers make several chunks, where that is cheap
    quick = {"seed": 7, "target_ess": 1500 if name == "optional term" else 50, "ensembles": 2}
    settings = SamplerSettings.model_validate(quick | {"method": method})
    job = fold.prepare(sensor, parse_scene(scene), simulated.frames, settings)
    stored_job = job.to_bytes()
    checkpoint, seen = fold.start(job), []
    before: fold.Checkpoint | None = None
    kept: list[bytes] = []  # as a store has it: a whole one, and what was appended since
    for _ in range(most):
        seen.append(type(checkpoint.stage))
        added = None if before is None else checkpoint.addition(before)
        kept = [checkpoint.to_bytes()] if added is None else [*kept, added]
        stored = fold.Checkpoint.from_bytes(*kept)
        assert same(stored, checkpoint)
        stage = checkpoint.stage
        was = 0 if before is None or not isinstance(before.stage, Walking) else before.stage.steps
        if isinstance(stage, Walking) and stage.steps > was > 0:  # steps are not written anew
            chains = sum(ensemble.chain.nbytes for ensemble in stage.ensembles)
            assert len(kept[-1]) < len(checkpoint.to_bytes()) - 0.5 * chains * was / stage.steps
        if isinstance(stage, Tempering) and stage.rounds and stage.rounds.steps > 5:
            assert len(kept[-1]) < 0.6 * len(checkpoint.to_bytes())  # nor are draws of rounds
        before = checkpoint
        again = fold.Job.from_bytes(stored_job)
        others = pieces = [fold.run(task) for task in fold.tasks(again, stored)]
        if seen.count(seen[-1]) < 5 or len(seen) % 4 == 0:  # of many of a kind every fourth
            pieces = [fold.run(task) for task in fold.tasks(job, checkpoint)]
            assert same(tuple(pieces), tuple(others))
        if not pieces or seen.count(Walking) > 3:
            break
        assert same(fold.merge(again, stored, others), fold.merge(job, checkpoint, pieces))
        checkpoint = fold.merge(job, checkpoint, pieces)
    stored = fold.Checkpoint.from_bytes(checkpoint.to_bytes())
    assert tuple(dict.fromkeys(seen)) == stages
    in_chunks = [stage for stage in stages if stage in (Tempering, Walking)]
    assert any(seen.count(stage) > 1 for stage in in_chunks) or not in_chunks
    direct = fold.summarise(job, checkpoint, 0.0, 0.0)
    resumed = fold.summarise(again, stored, 0.0, 0.0)
    assert direct.to_json() == resumed.to_json()
    assert np.array_equal(direct.draws.range_m, resumed.draws.range_m, equal_nan=True)


def test_pieces_of_another_stage_are_a_mistake() -> None:
    sensor = sensor_of("pulsed")
    settings = SamplerSettings(method="emcee", seed=7, target_ess=50)
    job = fold.prepare(sensor, parse_scene({}), data(sensor).frames, settings)
    checkpoint = begin(job, Starting())
    while not isinstance(checkpoint.stage, Walking):
        checkpoint = fold.merge(job, checkpoint, [fold.run(t) for t in fold.tasks(job, checkpoint)])
    with pytest.raises(TypeError, match="another stage"):
        fold.merge(job, checkpoint, [checkpoint])
