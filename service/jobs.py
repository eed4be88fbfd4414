"""Posteriors as jobs: a fold over short pure chunks, on any executor.

A job is never held in a worker. Between two chunks its checkpoint is stored, its progress is
reported, and a request to cancel is honoured; a chunk that was lost with its process is computed
again, to the same last bit.
"""

import asyncio
import logging
import math
import time
import uuid
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Any, Protocol, TypeVar

from service.draws_formats import write_draws
from service.errors import BusyError, ConflictError, GoneError, NotFoundError
from service.job_store import FINISHED, JobRecord, JobStore
from service.problems import describe
from service.worker import timed
from simulator.errors import HybridTofError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Fold", "Jobs"]

T = TypeVar("T")

_log = logging.getLogger("hybridtof")


class Fold(Protocol):
    """What `inference.posterior.fold` offers; every function is pure and importable by name."""

    Job: Any
    Checkpoint: Any

    def prepare(self, sensor: Sensor, scene: Scene, frames: Frames, settings: Any, /) -> Any:
        """Validate and refuse; resolve the seed."""

    def start(self, job: Any, /) -> Any:
        """Return the first checkpoint."""

    def tasks(self, job: Any, checkpoint: Any, /) -> Sequence[Any]:
        """Return the independent pieces of the next chunk; none when finished."""

    def run(self, task: Any, /) -> Any:
        """Compute one piece."""

    def merge(self, job: Any, checkpoint: Any, pieces: Sequence[Any], /) -> Any:
        """Return the next checkpoint."""

    def progress(self, job: Any, checkpoint: Any, /) -> Any:
        """Return steps, target, ess, rhat, finished."""

    def summarise(self, job: Any, checkpoint: Any, wall_s: float, cpu_s: float, /) -> Any:
        """Return the posterior so far."""

    def draw(self, job: Any, checkpoint: Any, /) -> Any:
        """Return the job as it was sampled and its draws."""


def _summary(summarise: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
    # made into JSON where it is computed: the draws stay in the worker
    result: dict[str, Any] = summarise(*arguments).to_json()
    return result


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _progress(progress: Any, wall_s: float) -> dict[str, Any]:
    """Progress as sent to clients, with the time left at the speed so far."""
    steps, target = int(progress.steps), int(progress.target)
    left = 0.0 if progress.finished else None
    if left is None and steps > 0:
        left = wall_s * max(target / steps - 1.0, 0.0)
    return {
        "steps": steps,
        "target": target,
        "ess": _finite(progress.ess),
        "rhat": _finite(progress.rhat),
        "eta_s": _finite(left),
    }


class Jobs:
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

    def __init__(self, fold: Fold, store: JobStore, executor: Executor, running: int) -> None:
        self._fold = fold
        self._store = store
        self._executor = executor
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
        settings: Any,
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
        record = JobRecord(
            id=uuid.uuid4().hex,
            job=await asyncio.to_thread(job.to_bytes),
            method=job.settings.method,
            seed=job.settings.seed,
            max_seconds=job.settings.max_seconds,
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
            One of `service.draws_formats.FORMATS`.

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
        fold = (self._fold.Job.from_bytes, self._fold.Checkpoint.from_bytes, self._fold.draw)
        data, _ = await self._execute(write_draws, fold, media_type, record.job, record.checkpoint)
        return data

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
                await self._advance(record)
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

    async def _execute(self, function: Callable[..., T], *arguments: Any) -> tuple[T, float]:
        """Run on the executor; return the result and the processor time [s]."""
        future = self._executor.submit(timed, function, *arguments)
        return await asyncio.wrap_future(future)

    async def _save(self, job_id: str, **changes: Any) -> JobRecord | None:
        return await asyncio.to_thread(lambda: self._store.update(job_id, **changes))

    async def _advance(self, record: JobRecord) -> None:
        """Fold until finished, cancelled, out of time or deleted; then summarise."""
        fold = self._fold
        began = time.monotonic() - record.wall_s
        cpu_s = record.cpu_s
        if await self._save(record.id, status="running") is None:
            return
        job = await asyncio.to_thread(fold.Job.from_bytes, record.job)
        if record.checkpoint is None:
            checkpoint, spent = await self._execute(fold.start, job)
            cpu_s += spent
        else:
            checkpoint = await asyncio.to_thread(fold.Checkpoint.from_bytes, record.checkpoint)
        while True:
            wall_s = time.monotonic() - began
            progress = await asyncio.to_thread(fold.progress, job, checkpoint)
            known = await self._save(
                record.id,
                checkpoint=await asyncio.to_thread(checkpoint.to_bytes),
                progress=_progress(progress, wall_s),
                wall_s=wall_s,
                cpu_s=cpu_s,
            )
            if known is None:
                return
            late = wall_s >= record.max_seconds
            if progress.finished or known.cancel_requested or late:
                break
            tasks = await asyncio.to_thread(fold.tasks, job, checkpoint)
            if not tasks:
                break
            pieces = await asyncio.gather(*(self._execute(fold.run, task) for task in tasks))
            cpu_s += math.fsum(spent for _, spent in pieces)
            checkpoint = await asyncio.to_thread(
                fold.merge, job, checkpoint, [piece for piece, _ in pieces]
            )
        result, _ = await self._execute(_summary, fold.summarise, job, checkpoint, wall_s, cpu_s)
        if late and not progress.finished:
            reason = f"stopped at the time limit of {record.max_seconds:g} s"
            result["verdict"] = {
                "converged": False,
                "reasons": [reason, *result["verdict"]["reasons"]],
            }
        cancelled = known.cancel_requested and not progress.finished
        status = "cancelled" if cancelled else "done"
        await self._save(record.id, status=status, result=result)
