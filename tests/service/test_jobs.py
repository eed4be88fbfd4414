"""Jobs on a real process pool: results, deaths, cancelling, time limits, taking up again."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from inference.posterior.settings import SamplerSettings
from service.errors import BusyError, IdempotencyError, NotFoundError
from service.job_store import JobRecord, MemoryJobStore
from service.jobs import Jobs
from service.process_pool import ProcessPool
from simulator.frames import Frames, frames_from_columns
from simulator.scene import Scene
from simulator.sensor import Sensor, parse_sensor
from tests.service import fake_fold
from tests.service.conftest import FRAMES, SENSOR

pytestmark = pytest.mark.anyio
FakeJobs = Jobs[fake_fold.Job, fake_fold.Checkpoint, fake_fold.Task, float]
SETTINGS = SamplerSettings(seed=5, ensembles=2)


def system() -> tuple[Sensor, Scene, Frames]:
    sensor = parse_sensor(SENSOR)
    return sensor, Scene(), frames_from_columns(sensor, FRAMES)


@asynccontextmanager
async def running(
    store: MemoryJobStore | None = None, workers: int = 2, running: int = 2
) -> AsyncIterator[tuple[FakeJobs, ProcessPool]]:
    pool = ProcessPool(workers)
    jobs = Jobs(fake_fold, store or MemoryJobStore(100), pool, running)
    await jobs.start()
    try:
        yield jobs, pool
    finally:
        await jobs.close()


async def ended(jobs: FakeJobs, job_id: str) -> JobRecord:
    assert await jobs.wait(job_id)
    return await jobs.get(job_id)


def mean_of(record: JobRecord) -> float:
    assert record.result is not None
    return float(record.result["parameters"]["object.c0"]["mean"])


async def undisturbed() -> float:
    fake_fold.order()
    async with running() as (jobs, _):
        record = await jobs.submit(*system(), SETTINGS)
        return mean_of(await ended(jobs, record.id))


async def until(jobs: FakeJobs, job_id: str, steps: int) -> None:
    while True:
        progress = (await jobs.get(job_id)).progress
        if progress is not None and progress["steps"] >= steps:
            return
        await asyncio.sleep(0.005)


async def test_done() -> None:
    fake_fold.order()
    async with running() as (jobs, _):
        record = await jobs.submit(*system(), SETTINGS)
        assert record.status == "queued"
        record = await ended(jobs, record.id)
    assert (record.status, record.problem, record.seed) == ("done", None, 5)
    assert record.progress == {"steps": 60, "target": 60, "ess": 60.0, "rhat": 7 / 6, "eta_s": 0.0}
    assert record.wall_s > 0
    assert record.result is not None
    assert record.result["verdict"] == {"converged": True, "reasons": []}


async def test_death_changes_nothing(tmp_path: Path) -> None:
    expected = await undisturbed()
    fake_fold.order(die=str(tmp_path / "mark"), deaths=1)
    async with running() as (jobs, _):
        record = await ended(jobs, (await jobs.submit(*system(), SETTINGS)).id)
    assert (tmp_path / "mark").read_text() == "x"
    assert record.status == "done"
    assert mean_of(record) == expected


async def test_killed_from_outside_changes_nothing(tmp_path: Path) -> None:
    expected = await undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running() as (jobs, pool):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        for pid in pool.pids:
            os.kill(pid, signal.SIGKILL)
        (tmp_path / "mark").touch()
        assert mean_of(await ended(jobs, job_id)) == expected


async def test_chunk_that_always_kills_fails_alone(tmp_path: Path) -> None:
    fake_fold.order(die=str(tmp_path / "mark"), deaths=100)
    async with running() as (jobs, _):
        bad = await jobs.submit(*system(), SETTINGS)
        fake_fold.order()
        good = await jobs.submit(*system(), SETTINGS)
        assert (await ended(jobs, good.id)).status == "done"
        record = await ended(jobs, bad.id)
    assert record.status == "failed"
    assert record.problem is not None
    assert record.problem["status"] == 500


async def test_failure_is_told(caplog: pytest.LogCaptureFixture) -> None:
    fake_fold.order(fail="no luck")
    async with running() as (jobs, _):
        record = await ended(jobs, (await jobs.submit(*system(), SETTINGS)).id)
    assert record.status == "failed"
    assert record.problem is not None
    assert record.problem["type"].endswith("internal")
    assert "no luck" in caplog.text


async def test_cancel_keeps_what_there_is(tmp_path: Path) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running() as (jobs, _):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        await jobs.cancel(job_id)
        (tmp_path / "mark").touch()
        record = await ended(jobs, job_id)
        assert record.status == "cancelled"
        assert record.result is not None
        assert record.result["verdict"]["converged"] is False
        assert record.progress is not None
        assert record.progress["steps"] < 60
        assert await jobs.cancel(job_id) == record


async def test_cancel_while_waiting_is_at_once(tmp_path: Path) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(running=1) as (jobs, _):
        first = await jobs.submit(*system(), SETTINGS)
        second = await jobs.submit(*system(), SETTINGS)
        assert (await jobs.cancel(second.id)).status == "cancelled"
        (tmp_path / "mark").touch()
        assert (await ended(jobs, first.id)).status == "done"
        record = await jobs.get(second.id)
    assert (record.status, record.result, record.progress) == ("cancelled", None, None)


async def test_time_limit() -> None:
    fake_fold.order(sleep=0.1)
    async with running() as (jobs, _):
        limited = SETTINGS.model_copy(update={"max_seconds": 0.15})
        record = await ended(jobs, (await jobs.submit(*system(), limited)).id)
    assert record.status == "done"
    assert record.result is not None
    verdict = record.result["verdict"]
    assert verdict["converged"] is False
    assert verdict["reasons"] == ["out of time"]


async def test_deleted_while_running(tmp_path: Path) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running() as (jobs, _):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        await jobs.delete(job_id)
        with pytest.raises(NotFoundError):
            await jobs.get(job_id)
        with pytest.raises(NotFoundError):
            await jobs.delete(job_id)
        with pytest.raises(NotFoundError):
            await jobs.cancel(job_id)


async def test_end_is_quick_and_another_process_takes_up(tmp_path: Path) -> None:
    """What one instance leaves behind, another finishes to the same last bit."""
    expected = await undisturbed()
    store = MemoryJobStore(100)
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store, running=1) as (jobs, pool):
        first = await jobs.submit(*system(), SETTINGS)
        second = await jobs.submit(*system(), SETTINGS)
        await until(jobs, first.id, 10)
    assert not pool.pids
    (tmp_path / "mark").touch()
    left = store.get(first.id)
    assert left is not None
    assert left.status == "running"
    assert left.checkpoint is not None
    async with running(store) as (jobs, _):
        for job_id in (first.id, second.id):
            record = await ended(jobs, job_id)
            assert record.status == "done"
            assert mean_of(record) == expected


async def test_idempotency() -> None:
    fake_fold.order()
    async with running() as (jobs, _):
        one = await jobs.submit(*system(), SETTINGS, key="k", digest="d")
        two = await jobs.submit(*system(), SETTINGS, key="k", digest="d")
        assert one.id == two.id
        with pytest.raises(IdempotencyError):
            await jobs.submit(*system(), SETTINGS, key="k", digest="other")
        await jobs.delete(one.id)
        three = await jobs.submit(*system(), SETTINGS, key="k", digest="other")
        assert three.id != one.id


async def test_no_room(tmp_path: Path) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(MemoryJobStore(2)) as (jobs, _):
        first = await jobs.submit(*system(), SETTINGS)
        await jobs.submit(*system(), SETTINGS)
        with pytest.raises(BusyError):
            await jobs.submit(*system(), SETTINGS)
        (tmp_path / "mark").touch()
        await ended(jobs, first.id)
        await jobs.submit(*system(), SETTINGS)
        with pytest.raises(NotFoundError):
            await jobs.get(first.id)
    with pytest.raises(BusyError):
        await jobs.submit(*system(), SETTINGS)


def test_pages_are_stable() -> None:
    store = MemoryJobStore(10)

    def add(name: str) -> JobRecord:
        fields: dict[str, Any] = {"job": b"", "method": "emcee", "seed": 1}
        return store.add(JobRecord(id=name, key=None, digest="", **fields))

    for name in "abcde":
        add(name)
    first = store.page(None, 2)
    add("f")
    store.delete("d")
    second = store.page(first[-1].sequence, 2)
    assert [r.id for r in first + second] == ["e", "d", "c", "b"]
