"""Jobs on a real process pool: results, deaths, cancelling, time limits, taking up again."""

import asyncio
import os
import signal
import sqlite3
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from inference.posterior.settings import SamplerSettings
from service.errors import BusyError, IdempotencyError, NotFoundError, StoreError
from service.jobs import Jobs
from service.process_pool import ProcessPool
from service.store.job_store import JobStore
from service.store.record import QUEUED, JobRecord
from service.store.retention import Retention
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
    store: JobStore, workers: int = 2, running: int = 2
) -> AsyncIterator[tuple[FakeJobs, ProcessPool]]:
    pool = ProcessPool(workers, stall_s=1.0)
    jobs = Jobs(fake_fold, store, pool, running, look_s=0.05)
    await jobs.start()
    try:
        yield jobs, pool
    finally:
        await jobs.close()


@pytest.fixture
def store(tmp_path: Path) -> JobStore:
    return JobStore(f"sqlite:///{tmp_path}/jobs.sqlite", Retention(100))


async def ended(jobs: FakeJobs, job_id: str) -> JobRecord:
    async for _ in jobs.follow(job_id):
        pass
    return await jobs.get(job_id)


def mean_of(record: JobRecord) -> float:
    assert record.result is not None
    return float(record.result["parameters"]["object.c0"]["mean"])


def undisturbed() -> float:
    """The first sum of a job that nobody disturbs."""
    job = fake_fold.Job(SETTINGS, {})
    checkpoint = fake_fold.start(job)
    while tasks := fake_fold.tasks(job, checkpoint, 0.0):
        checkpoint = fake_fold.merge(job, checkpoint, [fake_fold.run(task) for task in tasks])
    return checkpoint.sums[0]


async def until(jobs: FakeJobs, job_id: str, steps: int) -> None:
    async for record in jobs.follow(job_id):
        if record.progress["steps"] >= steps:
            return


async def test_done(store: JobStore) -> None:
    fake_fold.order()
    async with running(store) as (jobs, _):
        record = await jobs.submit(*system(), SETTINGS)
        assert record.status == "queued"
        record = await ended(jobs, record.id)
    assert (record.status, record.problem, record.seed) == ("done", None, 5)
    assert record.progress == {
        "phase": "summarising",
        "steps": 60,
        "target": 60,
        "ess": 60.0,
        "rhat": 7 / 6,
        "eta_s": 0.0,
    }
    assert record.wall_s > 0
    assert record.result is not None
    assert record.result["verdict"] == {"converged": True, "reasons": []}


async def test_death_changes_nothing(tmp_path: Path, store: JobStore) -> None:
    expected = undisturbed()
    fake_fold.order(die=str(tmp_path / "mark"), deaths=1)
    async with running(store) as (jobs, _):
        record = await ended(jobs, (await jobs.submit(*system(), SETTINGS)).id)
    assert (tmp_path / "mark").read_text() == "x"
    assert record.status == "done"
    assert mean_of(record) == expected


async def test_killed_from_outside_changes_nothing(tmp_path: Path, store: JobStore) -> None:
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, pool):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        for pid in pool.pids:
            os.kill(pid, signal.SIGKILL)
        (tmp_path / "mark").touch()
        assert mean_of(await ended(jobs, job_id)) == expected


async def test_chunk_that_always_kills_fails_alone(tmp_path: Path, store: JobStore) -> None:
    fake_fold.order(die=str(tmp_path / "mark"), deaths=100, signal=int(signal.SIGSEGV))
    async with running(store) as (jobs, _):
        bad = await jobs.submit(*system(), SETTINGS)
        fake_fold.order()
        good = await jobs.submit(*system(), SETTINGS)
        assert (await ended(jobs, good.id)).status == "done"
        record = await ended(jobs, bad.id)
    assert record.status == "failed"
    assert record.problem is not None
    assert record.problem["type"].endswith("worker-died")
    # what was drawn before is not lost
    assert record.result is not None
    assert record.result["verdict"]["converged"] is False
    assert (tmp_path / "mark").read_text() == "xxx"


async def test_failure_is_told(caplog: pytest.LogCaptureFixture, store: JobStore) -> None:
    fake_fold.order(fail="no luck")
    async with running(store) as (jobs, _):
        record = await ended(jobs, (await jobs.submit(*system(), SETTINGS)).id)
    assert record.status == "failed"
    assert record.problem is not None
    assert record.problem["type"].endswith("internal")
    assert record.result is None
    assert "no luck" in caplog.text


async def test_cancel_keeps_what_there_is(tmp_path: Path, store: JobStore) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, _):
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


async def test_cancel_while_waiting_is_at_once(tmp_path: Path, store: JobStore) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store, running=1) as (jobs, _):
        first = await jobs.submit(*system(), SETTINGS)
        second = await jobs.submit(*system(), SETTINGS)
        assert (await jobs.cancel(second.id)).status == "cancelled"
        (tmp_path / "mark").touch()
        assert (await ended(jobs, first.id)).status == "done"
        record = await jobs.get(second.id)
    assert (record.status, record.result, record.progress) == ("cancelled", None, QUEUED)


async def test_time_limit(store: JobStore) -> None:
    """It is the processor time of the chunks: two pieces, each of 0.1 s."""
    fake_fold.order(burn=0.1)
    async with running(store) as (jobs, _):
        limited = SETTINGS.model_copy(update={"max_seconds": 0.15})
        record = await ended(jobs, (await jobs.submit(*system(), limited)).id)
    assert record.status == "done"
    assert record.result is not None
    verdict = record.result["verdict"]
    assert verdict["converged"] is False
    assert verdict["reasons"] == ["out of time"]
    assert record.progress["steps"] == 10


async def test_turns_go_round_clients(store: JobStore) -> None:
    """A client with one job among three greedy ones does not wait for theirs to end."""
    expected = undisturbed()
    fake_fold.order()
    pool = ProcessPool(1)
    jobs: FakeJobs = Jobs(fake_fold, store, pool, running=1, look_s=0.05, slice_s=0.0)
    await jobs.start()
    try:
        greedy = [await jobs.submit(*system(), SETTINGS, client="greedy") for _ in range(3)]
        modest = await jobs.submit(*system(), SETTINGS, client="modest")
        async for _ in jobs.follow(modest.id, client="modest"):
            pass
        steps = [(await jobs.get(job.id, "greedy")).progress["steps"] for job in greedy]
        assert (await jobs.get(modest.id, "modest")).status == "done"
        # a chunk of modest's for one of greedy's, before modest came perhaps a few more
        assert sum(steps) < 3 * 60
        for job in greedy:
            async for _ in jobs.follow(job.id, client="greedy"):
                pass
            assert mean_of(await jobs.get(job.id, "greedy")) == expected
    finally:
        await jobs.close()


async def test_deleted_while_running(tmp_path: Path, store: JobStore) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, _):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        await jobs.delete(job_id)
        with pytest.raises(NotFoundError):
            await jobs.get(job_id)
        with pytest.raises(NotFoundError):
            await jobs.delete(job_id)
        with pytest.raises(NotFoundError):
            await jobs.cancel(job_id)


async def test_end_is_quick_and_another_takes_up(tmp_path: Path, store: JobStore) -> None:
    """What one instance leaves behind, another finishes to the same last bit."""
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store, running=1) as (jobs, pool):
        first = await jobs.submit(*system(), SETTINGS)
        second = await jobs.submit(*system(), SETTINGS)
        await until(jobs, first.id, 10)
    assert not pool.pids
    (tmp_path / "mark").touch()
    left = store.drawn(first.id)
    assert left is not None
    assert left.record.status == "running"
    assert left.pieces
    async with running(store) as (jobs, _):
        for job_id in (first.id, second.id):
            record = await ended(jobs, job_id)
            assert record.status == "done"
            assert mean_of(record) == expected


async def test_idempotency(store: JobStore) -> None:
    fake_fold.order()
    async with running(store) as (jobs, _):
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
    small = JobStore(f"sqlite:///{tmp_path}/jobs.sqlite", Retention(2))
    async with running(small) as (jobs, _):
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


async def test_stopped_worker_is_replaced(tmp_path: Path, store: JobStore) -> None:
    """It takes no processor time: another process computes its chunk."""
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, pool):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        for pid in pool.pids:
            os.kill(pid, signal.SIGSTOP)
        (tmp_path / "mark").touch()
        assert mean_of(await ended(jobs, job_id)) == expected


async def test_cancel_while_a_worker_is_stopped(tmp_path: Path, store: JobStore) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, pool):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        for pid in pool.pids:
            os.kill(pid, signal.SIGSTOP)
        record = await jobs.cancel(job_id)
        assert record.cancel_requested
        record = await ended(jobs, job_id)  # although no chunk ever ends
    assert record.status == "cancelled"
    assert record.result is not None


async def test_two_processes_share_a_store(tmp_path: Path, store: JobStore) -> None:
    """Jobs are shared out; each sees what the other has done, and what it has cancelled."""
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    other = JobStore(f"sqlite:///{tmp_path}/jobs.sqlite", Retention(100))
    async with running(store, 1, 1) as (here, _), running(other, 1, 1) as (there, _):
        ids = [(await here.submit(*system(), SETTINGS)).id for _ in range(3)]
        for job_id in ids[:2]:  # both run although each process runs one at a time
            await until(there, job_id, 10)
        await there.cancel(ids[0])
        assert (await ended(here, ids[0])).status == "cancelled"
        (tmp_path / "mark").touch()
        for job_id in ids[1:]:
            assert mean_of(await ended(there, job_id)) == expected


async def test_of_another_version_is_computed_anew(tmp_path: Path, store: JobStore) -> None:
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    async with running(store) as (jobs, _):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
    with sqlite3.connect(tmp_path / "jobs.sqlite") as file:
        file.execute("UPDATE job SET format = 'older'")
        file.execute("UPDATE checkpoint SET bytes = x'00'")
    file.close()
    (tmp_path / "mark").touch()
    async with running(store) as (jobs, _):
        assert mean_of(await ended(jobs, job_id)) == expected


async def test_store_that_is_locked_for_a_while(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing is accepted that would not be kept, and what was accepted goes on afterwards."""
    expected = undisturbed()
    fake_fold.order(hold=str(tmp_path / "mark"))
    store = JobStore(f"sqlite:///{tmp_path}/jobs.sqlite", Retention(100), busy_s=0.01)
    async with running(store) as (jobs, _):
        job_id = (await jobs.submit(*system(), SETTINGS)).id
        await until(jobs, job_id, 10)
        with sqlite3.connect(tmp_path / "jobs.sqlite", isolation_level=None) as file:
            file.execute("BEGIN IMMEDIATE")
            with pytest.raises(StoreError, match="cannot be written now: database is locked"):
                await jobs.submit(*system(), SETTINGS)
            (tmp_path / "mark").touch()
            while "waits: " not in caplog.text:
                await asyncio.sleep(0.01)
            file.execute("ROLLBACK")
        file.close()
        assert mean_of(await ended(jobs, job_id)) == expected
        assert len(await jobs.page(None, 10)) == 1
