"""One posterior, from its first chunk to its summary.

Between two chunks the checkpoint is stored, progress is told, and a request to cancel is honoured;
a chunk that was lost with its process is computed again, to the same last bit.
"""

import asyncio
import contextlib
import dataclasses
import logging
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, Generic

from inference.posterior.pace import Pace
from inference.posterior.progress import Progress
from service.errors import GoneError, StoreError
from service.fold import C, Fold, J, P, Summary, T
from service.held_job import HeldJob, LostError
from service.problems import describe
from service.store.job_store import JobStore
from service.store.record import Claimed, JobRecord, Status
from service.workers import Workers
from simulator.errors import HybridTofError
from simulator.processor_time import timed

__all__ = ["Runner"]

_log = logging.getLogger("hybridtof")

_LOOK_S = 0.25  # how often it is looked whether a job is still wanted
_GRACE_S = 1.0  # what a chunk may still take when its job was cancelled
# processor time that a chunk may take before its process is ended: of the first of a phase, and of
# one that follows others like it, whose cost is known
_FIRST_LIMIT_S = 900.0
_LIMIT_S = 60.0
_TIMES = 20.0


class _TurnError(Exception):
    """The job has had its turn, and others wait."""


class _CancelledError(Exception):
    """The job was cancelled while a chunk ran, which was given up."""


def _summary(summarise: Callable[..., Summary], *arguments: Any) -> dict[str, Any]:
    # made into JSON where it is computed: the draws stay in the worker
    return summarise(*arguments).to_json()


def _sent(progress: Progress) -> dict[str, Any]:
    """Return progress as sent to clients: what is unknown, or not finite, is null."""
    members = dataclasses.asdict(progress)
    del members["finished"]
    unknown = {k for k, v in members.items() if isinstance(v, float) and not math.isfinite(v)}
    return members | dict.fromkeys(unknown)


@dataclasses.dataclass(frozen=True, slots=True)
class Runner(Generic[J, C, T, P]):
    """Folds jobs, each in a call of its own.

    Attributes
    ----------
    fold : Fold
        The computation.
    store : JobStore
        Where jobs are kept between chunks.
    workers : Workers
        Where chunks run.
    version : str
        Names the format of jobs and checkpoints: those of another one are computed anew.
    announce : callable
        Is called when a job has changed.
    holder : str
        Under which name this process holds jobs.
    slice_s : float
        Processor time of a turn [s].
    """

    fold: Fold[J, C, T, P]
    store: JobStore
    workers: Workers
    version: str
    announce: Callable[[], None]
    holder: str
    slice_s: float

    async def run(self, claimed: Claimed) -> None:
        """Fold until finished, cancelled, out of time or deleted; then summarise.

        Where others wait, it ends after a turn, and the job goes on with another.

        Parameters
        ----------
        claimed : Claimed
            The job, new or as another process left it.
        """
        await _Run(self, claimed).run()


class _Run(Generic[J, C, T, P]):
    """One job in the hands of this process."""

    def __init__(self, runner: Runner[J, C, T, P], claimed: Claimed) -> None:
        self.runner, self.claimed = runner, claimed
        self.held = HeldJob(runner.store, claimed.record, runner.announce)
        self.cpu_s = claimed.record.cpu_s
        self.pace: Pace | None = None
        self.checkpoint: C | None = None
        self.longest = 0.0  # processor time of a chunk of the present phase [s]

    @property
    def record(self) -> JobRecord:
        """The job as it stands."""
        return self.held.record

    async def run(self) -> None:
        try:
            await self._read()
            await self._compute()
        except LostError:
            return
        except _TurnError:
            await self._let_go()
        except Exception as error:
            known = error if isinstance(error, HybridTofError) else None
            if known is None:
                _log.exception("posterior %s failed", self.record.id)
            await self._fail(describe(known or HybridTofError(type(error).__name__)))

    async def _read(self) -> None:
        """Read the job, and its checkpoint where it is in the form of today."""
        fold, pieces, store = self.runner.fold, self.claimed.pieces, self.runner.store
        self.began = time.monotonic() - self.record.wall_s
        if self.record.format != self.runner.version:
            await self.held.save(store.restart, self.record, self.runner.version)
            self.cpu_s, pieces = 0.0, ()
        try:
            self.job = await asyncio.to_thread(fold.Job.from_bytes, self.claimed.job)
            if pieces:
                self.checkpoint = await asyncio.to_thread(fold.Checkpoint.from_bytes, *pieces)
                await self.held.tell(fold.progress(self.job, self.checkpoint).phase)
        except LostError:
            raise
        except Exception as error:
            if self.claimed.record.format == self.runner.version:
                raise
            message = "it was accepted by another version of hybridtof, and cannot be read by this"
            raise GoneError(message) from error

    async def _compute(self) -> None:
        fold = self.runner.fold
        try:
            if self.checkpoint is None:
                await self.held.tell("starting")
                (first,) = await self._execute((fold.start, self.job))
                await self._keep(first)
            while self.checkpoint is not None and not self.record.cancel_requested:
                tasks = await asyncio.to_thread(fold.tasks, self.job, self.checkpoint, self.cpu_s)
                if not tasks:
                    break
                pieces = await self._execute(*((fold.run, task) for task in tasks))
                merged, spent = await asyncio.to_thread(self._merged, self.checkpoint, pieces)
                self.cpu_s += spent
                await self._keep(merged)
                if self.cpu_s - self.claimed.record.cpu_s >= self.runner.slice_s:
                    await self._see_to_others()
        except _CancelledError:
            pass
        finished = False
        if self.checkpoint is not None:
            finished = fold.progress(self.job, self.checkpoint).finished
        cancelled = self.record.cancel_requested and not finished
        result = await self._summarise()
        await self._finish("cancelled" if cancelled else "done", result)

    async def _see_to_others(self) -> None:
        """End the turn, where others wait for theirs."""
        if self.record.cancel_requested:
            return
        with contextlib.suppress(StoreError):
            if await asyncio.to_thread(self.runner.store.waits):
                raise _TurnError

    async def _let_go(self) -> None:
        with contextlib.suppress(StoreError):  # the lease runs out by itself
            await asyncio.to_thread(self.runner.store.release, self.runner.holder, self.record.id)

    def _merged(self, checkpoint: C, pieces: Sequence[P]) -> tuple[C, float]:
        before = time.thread_time()
        merged = self.runner.fold.merge(self.job, checkpoint, pieces)
        return merged, time.thread_time() - before

    async def _summarise(self) -> dict[str, Any] | None:
        """Return the answer of what there is; None where there is nothing."""
        if self.checkpoint is None:
            return None
        await self.held.tell("summarising")
        spent = self.record.wall_s, self.cpu_s
        call = _summary, self.runner.fold.summarise, self.job, self.checkpoint, *spent
        (result,) = await self._execute(call, wanted=True)
        # the answer has cost something too
        whole = {"wall_s": time.monotonic() - self.began, "cpu_s": self.cpu_s}
        return dict(result) | {"runtime": result["runtime"] | whole}

    async def _fail(self, problem: dict[str, Any]) -> None:
        """End the job, with what was drawn before it failed."""
        result = None
        try:
            if self.record.progress["steps"] > 0:
                result = await self._summarise()
        except Exception as error:
            _log.warning("posterior %s has no summary: %r", self.record.id, error)
        await self._finish("failed", result, problem)

    async def _finish(
        self,
        status: Status,
        result: dict[str, Any] | None,
        problem: dict[str, Any] | None = None,
    ) -> None:
        with contextlib.suppress(LostError):
            await self.held.save(self.runner.store.finish, self.record, status, result, problem)

    async def _keep(self, checkpoint: C) -> None:
        """Store a checkpoint: what it adds to the last one, or all of it."""
        runner, before = self.runner, self.checkpoint
        wall_s = time.monotonic() - self.began
        progress = await asyncio.to_thread(runner.fold.progress, self.job, checkpoint)
        self.pace = Pace.followed(self.pace, progress, wall_s)
        # the pieces of a start are as unlike one another as phases are
        if progress.phase == "starting" or progress.phase != self.record.progress["phase"]:
            self.longest = 0.0
        added = None
        if before is not None:
            added = await asyncio.to_thread(checkpoint.addition, before)
        data = added if added is not None else await asyncio.to_thread(checkpoint.to_bytes)
        told = _sent(self.pace.foretell(progress, wall_s))
        spent = wall_s, self.cpu_s
        await self.held.save(runner.store.advance, self.record, data, added is None, told, *spent)
        self.checkpoint = checkpoint

    async def _execute(self, *calls: tuple[Any, ...], wanted: bool = False) -> list[Any]:
        """Run calls side by side in the workers; return their results.

        Parameters
        ----------
        *calls : tuple
            A function and its arguments.
        wanted : bool
            Whether they are wanted although the job was cancelled.

        Raises
        ------
        _CancelledError
            Where the job is cancelled before they have ended.
        """
        workers = self.runner.workers
        limit_s = _LIMIT_S + _TIMES * self.longest if self.longest else _FIRST_LIMIT_S
        futures = [workers.submit_within(limit_s, timed, *call) for call in calls]
        answers = [asyncio.wrap_future(future) for future in futures]
        try:
            await self._await(futures, answers, wanted)
            found = [answer.result() for answer in answers]
        finally:
            for future, answer in zip(futures, answers, strict=True):
                if not answer.done():
                    answer.cancel()
                    workers.abandon(future)
        self.cpu_s += math.fsum(spent for _, spent in found)
        self.longest = max(self.longest, *(spent for _, spent in found))
        return [result for result, _ in found]

    async def _await(
        self,
        futures: Sequence[Future[Any]],
        answers: Sequence["asyncio.Future[Any]"],
        wanted: bool,
    ) -> None:
        """Return when all have ended or one has failed; see in between to the job."""
        phase, cancelled = self.record.progress["phase"], False
        while True:
            ended, running = await asyncio.wait(
                answers,
                timeout=_GRACE_S if cancelled else _LOOK_S,
                return_when=asyncio.FIRST_EXCEPTION,
            )
            for answer in ended:
                answer.result()  # one that failed says so
            if not running:
                break
            if cancelled:
                raise _CancelledError
            compiling = any(map(self.runner.workers.compiling, futures))
            await self.held.tell("compiling" if compiling else phase)
            cancelled = await self.held.look() and not wanted
        await self.held.tell(phase)
