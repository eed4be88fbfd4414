"""One posterior, from its first chunk to its summary.

Between two chunks the checkpoint is stored, progress is reported, and a request to cancel is
honoured; a chunk that was lost with its process is computed again, to the same last bit.
"""

import asyncio
import math
import time
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, Generic, TypeVar

from service.exports.writing import write_draws
from service.fold import C, Fold, FoldProgress, J, P, Summary, T
from service.job_store import JobRecord, JobStore
from service.worker import timed

__all__ = ["Runner"]

R = TypeVar("R")


def _summary(summarise: Callable[..., Summary], *arguments: Any) -> dict[str, Any]:
    # made into JSON where it is computed: the draws stay in the worker
    return summarise(*arguments).to_json()


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _progress(progress: FoldProgress, wall_s: float) -> dict[str, Any]:
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


class Runner(Generic[J, C, T, P]):
    """Folds jobs, one at a call.

    Parameters
    ----------
    fold : Fold
        The computation.
    store : JobStore
        Where jobs are kept between chunks.
    executor : concurrent.futures.Executor
        Where chunks run.
    """

    def __init__(self, fold: Fold[J, C, T, P], store: JobStore, executor: Executor) -> None:
        self._fold = fold
        self._store = store
        self._executor = executor

    async def run(self, record: JobRecord) -> None:
        """Fold until finished, cancelled, out of time or deleted; then summarise.

        Parameters
        ----------
        record : JobRecord
            The job, new or as another process left it.
        """
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
            if known.cancel_requested:
                break
            tasks = await asyncio.to_thread(fold.tasks, job, checkpoint, wall_s)
            if not tasks:
                break
            pieces = await asyncio.gather(*(self._execute(fold.run, task) for task in tasks))
            cpu_s += math.fsum(spent for _, spent in pieces)
            checkpoint = await asyncio.to_thread(
                fold.merge, job, checkpoint, [piece for piece, _ in pieces]
            )
        result, _ = await self._execute(_summary, fold.summarise, job, checkpoint, wall_s, cpu_s)
        cancelled = known.cancel_requested and not progress.finished
        status = "cancelled" if cancelled else "done"
        await self._save(record.id, status=status, result=result)

    async def draws(self, record: JobRecord, checkpoint: bytes, media_type: str) -> bytes:
        """Return the draws that a job's checkpoint stands for, as a file."""
        fold = self._fold
        readers = (fold.Job.from_bytes, fold.Checkpoint.from_bytes)
        data, _ = await self._execute(
            write_draws, *readers, fold.draw, media_type, record.job, checkpoint
        )
        return data

    async def _execute(self, function: Callable[..., R], *arguments: Any) -> tuple[R, float]:
        """Run on the executor; return the result and the processor time [s]."""
        future = self._executor.submit(timed, function, *arguments)
        return await asyncio.wrap_future(future)

    async def _save(self, job_id: str, **changes: Any) -> JobRecord | None:
        return await asyncio.to_thread(lambda: self._store.update(job_id, **changes))
