"""A time limit belongs to the computation: whoever drives it, the answer is the same."""

import asyncio
import itertools
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import pytest

import inference.posterior.infer
import service.job_runner
from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from service.jobs import Jobs
from service.store.job_store import JobStore
from service.store.retention import Retention
from simulator.scene import parse_scene
from tests.chunk_clock import timed
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, example, sensor_of

R = TypeVar("R")
OUT_OF_TIME = "stopped at the time limit of {} s"


class _Clock:
    """A module `time` by whose clock of a thread, which merges, every reading is a second later."""

    def __init__(self) -> None:
        self.monotonic = time.monotonic
        self.thread_time: Callable[[], float] = itertools.count().__next__


class _Threads(ThreadPoolExecutor):
    """Workers whose clock can be replaced."""

    def submit_within(self, _: float, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        return self.submit(fn, *args)

    def compiling(self, _: Future[Any]) -> bool:
        return False

    def abandon(self, future: Future[Any]) -> None:
        future.cancel()


async def _by_jobs(path: Path, request: Any, settings: SamplerSettings) -> dict[str, Any]:
    store = JobStore(f"sqlite:///{path}/jobs.sqlite", Retention(1))
    jobs = Jobs(fold, store, _Threads(2), running=1)
    await jobs.start()
    try:
        sensor, scene, frames = request
        record = await jobs.submit(sensor, scene, frames, settings)
        async for now in jobs.follow(record.id):
            record = now
    finally:
        await jobs.close()
    assert record.result is not None
    return record.result


# a second for the start, and one for every chunk
@pytest.mark.parametrize(
    ("max_seconds", "optional"),
    [
        (1.0, False),
        (1.0, True),
        pytest.param(2.5, False, marks=pytest.mark.thorough),
        pytest.param(2.5, True, marks=pytest.mark.thorough),
        (1000.0, False),
        pytest.param(1000.0, True, marks=pytest.mark.thorough),
    ],
)
def test_the_same_answer_from_a_call_and_from_the_service(
    max_seconds: float, optional: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crosstalk = {"values": UNKNOWN_CROSSTALK, "optional": True} if optional else UNKNOWN_CROSSTALK
    sensor = sensor_of("pulsed")
    frames = data(sensor, {"crosstalk": [0.002, 0.01]}, frames=8).frames
    plate = {name: OBJECT[name] for name in ("c0", "c1")}
    request = sensor, parse_scene({"object": plate, "crosstalk": crosstalk}), frames
    target = 1_000_000 if max_seconds < 100 else 50
    settings = SamplerSettings(seed=7, ensembles=2, target_ess=target, max_seconds=max_seconds)
    called = inference.posterior.infer.infer(*request, settings).to_json()
    monkeypatch.setattr(service.job_runner, "time", _Clock())
    monkeypatch.setattr(service.job_runner, "timed", timed)
    served = asyncio.run(_by_jobs(tmp_path, request, settings))
    assert called.pop("runtime").keys() == served.pop("runtime").keys()
    assert called == served
    stopped = OUT_OF_TIME.format(f"{max_seconds:g}") in called["verdict"]["reasons"]
    assert stopped == (max_seconds < 100)
    assert called["verdict"]["converged"] != stopped


def test_run_time_is_that_of_the_whole_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of its summary too."""

    def by_name(function: Callable[..., R], *arguments: Any) -> tuple[R, float]:
        return function(*arguments), 7.0 * function.__name__.strip("_").startswith("summar")

    sensor, scene, frames = example("pulsed", crosstalk=False)
    settings = SamplerSettings(method="importance", seed=7, target_ess=50)
    monkeypatch.setattr(inference.posterior.infer, "timed", by_name)
    monkeypatch.setattr(service.job_runner, "timed", by_name)
    runtime = inference.posterior.infer.infer(sensor, scene, frames, settings).runtime
    served = asyncio.run(_by_jobs(tmp_path, (sensor, scene, frames), settings))["runtime"]
    assert runtime.cpu_s == 7.0
    assert 7.0 <= served["cpu_s"] < 8.0  # merging is timed by a clock of its own
    assert min(runtime.wall_s, served["wall_s"]) > 0.0
    assert runtime.likelihood_calls == served["likelihood_calls"] > 0


def test_a_finished_job_was_not_stopped() -> None:
    """The limit may pass while the answer is made: nothing was cut short then."""
    settings = SamplerSettings(seed=7, target_ess=50, max_seconds=60)
    job = fold.prepare(*example("pulsed", crosstalk=False), settings)
    checkpoint = fold.start(job)
    assert fold.tasks(job, checkpoint, 59.9)
    assert fold.tasks(job, checkpoint, 60.0) == ()
    while pieces := [fold.run(task) for task in fold.tasks(job, checkpoint)]:
        checkpoint = fold.merge(job, checkpoint, pieces)
    late = fold.summarise(job, checkpoint, 61.0, 61.0).verdict
    assert late == fold.summarise(job, checkpoint, 0.0, 0.0).verdict
    assert late.converged
