"""Jobs on a real Dask cluster: cancelled, stopped, and with chunks that end every process."""

import os
import signal
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="Dask is not installed: hybridtof[cluster]")

from benchmarks.cluster import Cluster as Machines
from service.cluster import Cluster
from service.jobs import Jobs
from service.store.job_store import JobStore
from service.store.retention import Retention
from tests.service import fake_fold
from tests.service.test_jobs import (
    SETTINGS,
    FakeJobs,
    ended,
    mean_of,
    system,
    undisturbed,
    until,
)

pytestmark = [pytest.mark.anyio, pytest.mark.slow]
# after which a scheduler takes a silent worker for dead; five minutes where nothing is said, as one
# that imports is silent for as long as a busy machine takes
SILENT = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "3s"}


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    with machines_of({}, tmp_path_factory.mktemp("cluster")) as running:
        yield running


@contextmanager
def machines_of(dask: dict[str, str], folder: Path) -> Iterator[Machines]:
    running = Machines(dask, folder, 2, "tcp")
    try:
        yield running
    finally:
        running.end()


@asynccontextmanager
async def on(machines: Machines, folder: Path) -> AsyncIterator[FakeJobs]:
    store = JobStore(f"sqlite:///{folder}/jobs.sqlite", Retention(100))
    cluster = Cluster(machines.settings["HYBRIDTOF_EXECUTOR"])
    jobs = Jobs(fake_fold, store, cluster, running=2, look_s=0.05)
    await jobs.start()
    try:
        yield jobs
    finally:
        fake_fold.order()
        await jobs.close()


async def test_cancel_does_not_wait_for_a_chunk(machines: Machines, tmp_path: Path) -> None:
    """No chunk of it but the first ever ends; its processes are ended, and make room."""
    fake_fold.order(hold=str(tmp_path / "never"))
    async with on(machines, tmp_path) as jobs:
        held = await jobs.submit(*system(), SETTINGS)
        await until(jobs, held.id, fake_fold.STEPS)
        await jobs.cancel(held.id)
        record = await ended(jobs, held.id)
        assert record.status == "cancelled"
        assert record.result is not None
        fake_fold.order()
        after = await jobs.submit(*system(), SETTINGS)
        assert mean_of(await ended(jobs, after.id)) == undisturbed()


async def test_chunk_that_always_crashes_fails_alone(machines: Machines, tmp_path: Path) -> None:
    """After three tries, of which the workers of the cluster notice nothing."""
    workers = {name: pid for name, pid in machines.pids().items() if name.startswith("worker")}
    fake_fold.order(die=str(tmp_path / "mark"), deaths=100, signal=int(signal.SIGSEGV))
    async with on(machines, tmp_path) as jobs:
        bad = await jobs.submit(*system(), SETTINGS)
        fake_fold.order()
        good = await jobs.submit(*system(), SETTINGS)
        assert mean_of(await ended(jobs, good.id)) == undisturbed()
        record = await ended(jobs, bad.id)
    assert record.status == "failed"
    assert record.problem is not None
    assert record.problem["type"].endswith("worker-died")
    assert record.result is not None
    assert (tmp_path / "mark").read_text() == "xxx"
    assert workers.items() <= machines.pids().items()


@pytest.mark.thorough
async def test_a_worker_that_is_stopped_is_done_without(tmp_path: Path) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    with machines_of(SILENT, tmp_path) as machines:
        async with on(machines, tmp_path) as jobs:
            job_id = (await jobs.submit(*system(), SETTINGS)).id
            await until(jobs, job_id, fake_fold.STEPS)
            stopped = machines.pids()["worker 0"]
            os.kill(stopped, signal.SIGSTOP)
            try:
                (tmp_path / "mark").touch()
                assert mean_of(await ended(jobs, job_id)) == undisturbed()
            finally:
                os.kill(stopped, signal.SIGCONT)
