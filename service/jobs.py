"""Posteriors as jobs: a fold over short pure chunks, on any executor.

A job is never held in a worker: what runs there is one chunk (`service.job_runner`), and between
two of them the job is in the store.
"""

import asyncio
import logging
import uuid
from concurrent.futures import Executor
from typing import Any, Generic

from inference.posterior.settings import SamplerSettings
from service.errors import BusyError, ConflictError, GoneError, NotFoundError
from service.fold import C, Fold, J, P, T
from service.job_runner import Runner
from service.job_store import FINISHED, JobRecord, JobStore
from service.problems import describe
from simulator.errors import HybridTofError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Jobs"]

_log = logging.getLogger("hybridtof")


class Jobs(Generic[J, C, T, P]):
    """Runs the posteriors of one process.

    Parameters
    ----------
    fold : Fold
        The computation, such as the module `inference.posterior.fold`.
    store : JobStore
        Where jobs are kept between chunks.
    executor : concurrent.futures.Executor
        Where chunks run.
    running : int
        How many jobs run at a time; the others wait in the order of their arrival.
    """

    def __init__(
        self, fold: Fold[J, C, T, P], store: JobStore, executor: Executor, running: int
    ) -> None:
        self._fold = fold
        self._store = store
        self._executor = executor
        self._runner = Runner(fold, store, executor)
        self._running = running
        self._slots = asyncio.Semaphore(running)
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._waiting: set[str] = set()
        self._open = False

    @property
    def open(self) -> bool:
        """Whether jobs are taken."""
        return self._open

    async def start(self) -> None:
        """Take jobs, first those that the store holds unfinished."""
        self._slots = asyncio.Semaphore(self._running)
        self._open = True
        for record in await asyncio.to_thread(self._store.unfinished):
            self._schedule(record)

    async def close(self) -> None:
        """Stop between two instructions; what ran stays unfinished in the store."""
        self._open = False
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        # the processes are killed: a chunk is cheap to repeat, a shutdown must not wait for it
        await asyncio.to_thread(self._executor.shutdown, True, cancel_futures=True)
        await asyncio.gather(*tasks, return_exceptions=True)

    async def submit(
        self,
        sensor: Sensor,
        scene: Scene,
        frames: Frames,
        settings: SamplerSettings,
        *,
        key: str | None = None,
        digest: str = "",
    ) -> JobRecord:
        """Prepare a job and let it run.

        Parameters
        ----------
        sensor, scene, frames
            What was asked.
        settings : SamplerSettings
            How to sample.
        key, digest : str
            Idempotency key and a digest of the request.

        Returns
        -------
        JobRecord
            Of the new job, or of the one that came with the same key before.

        Raises
        ------
        InvalidInputError, RefusedError
            Where `Fold.prepare` raises them.
        IdempotencyError
            Where the key came with another request.
        BusyError
            Where there is no room, or the service is ending.
        """
        if not self._open:
            raise BusyError("the service is ending")
        job = await asyncio.to_thread(self._fold.prepare, sensor, scene, frames, settings)
        seed = job.settings.seed
        if seed is None:
            raise ValueError("`Fold.prepare` resolves the seed")
        record = JobRecord(
            id=uuid.uuid4().hex,
            job=await asyncio.to_thread(job.to_bytes),
            method=job.settings.method,
            seed=seed,
            key=key,
            digest=digest,
        )
        kept = await asyncio.to_thread(self._store.add, record)
        if kept.id == record.id:
            self._schedule(kept)
        return kept

    async def get(self, job_id: str) -> JobRecord:
        """Return a job as it stands.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        record = await asyncio.to_thread(self._store.get, job_id)
        if record is None:
            raise NotFoundError("there is no posterior of this id")
        return record

    async def page(self, after: int | None, limit: int) -> list[JobRecord]:
        """Return jobs, newest first; see `JobStore.page`."""
        return await asyncio.to_thread(self._store.page, after, limit)

    async def draws(self, job_id: str, media_type: str) -> bytes:
        """Return the draws of a finished job, made anew from its last checkpoint.

        Parameters
        ----------
        job_id : str
            Which job.
        media_type : str
            Of one of `service.exports.EXPORTS`.

        Returns
        -------
        bytes
            A file.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        ConflictError
            Where the job has not ended, or ended without draws.
        GoneError
            Where the draws had to make room for others.
        """
        record = await self.get(job_id)
        if record.status not in FINISHED:
            raise ConflictError("the posterior is not finished: wait for it, or cancel it")
        if record.status == "failed" or record.result is None:
            raise ConflictError("this posterior ended before anything was drawn")
        if record.checkpoint is None:
            raise GoneError(
                "the draws made room for those of other posteriors; the same request with this "
                "seed gives the same draws"
            )
        return await self._runner.draws(record, record.checkpoint, media_type)

    async def cancel(self, job_id: str) -> JobRecord:
        """End a job after the chunk that runs; one that has ended is left as it is.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        record = await self.get(job_id)
        if record.status in FINISHED:
            return record
        changes: dict[str, Any] = {"cancel_requested": True}
        if job_id in self._waiting:
            self._waiting.discard(job_id)
            self._tasks[job_id].cancel()
            changes["status"] = "cancelled"
        changed = await asyncio.to_thread(lambda: self._store.update(job_id, **changes))
        return changed or record

    async def delete(self, job_id: str) -> None:
        """Forget a job; if it runs, its last chunk is thrown away.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        if not await asyncio.to_thread(self._store.delete, job_id):
            raise NotFoundError("there is no posterior of this id")
        if job_id in self._tasks:
            self._tasks[job_id].cancel()

    async def wait(self, job_id: str, timeout_s: float | None = None) -> bool:
        """Wait for the end of a job of this process, or for a time; whether it has ended."""
        task = self._tasks.get(job_id)
        if task is not None:
            await asyncio.wait([task], timeout=timeout_s)
        return task is None or task.done()

    def _schedule(self, record: JobRecord) -> None:
        task = asyncio.get_running_loop().create_task(self._run(record))
        self._tasks[record.id] = task
        self._waiting.add(record.id)
        task.add_done_callback(lambda _: self._tasks.pop(record.id, None))

    async def _run(self, record: JobRecord) -> None:
        try:
            async with self._slots:
                self._waiting.discard(record.id)
                await self._runner.run(record)
        except HybridTofError as error:
            await self._fail(record.id, describe(error))
        except Exception as error:
            _log.exception("posterior %s failed", record.id)
            await self._fail(record.id, describe(HybridTofError(type(error).__name__)))
        finally:
            self._waiting.discard(record.id)

    async def _fail(self, job_id: str, problem: dict[str, Any]) -> None:
        await asyncio.to_thread(
            lambda: self._store.update(job_id, status="failed", problem=problem, checkpoint=None)
        )
