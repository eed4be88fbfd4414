"""Posteriors as jobs: a fold over short pure chunks, on any executor.

A job is never held in a worker: what runs there is one chunk (`service.job_runner`), and between
two of them the job is in the store, which other processes may share.
"""

import asyncio
import contextlib
import logging
import uuid
from collections.abc import AsyncIterator
from importlib.metadata import version
from typing import Generic

from inference.posterior.settings import SamplerSettings
from service.ended import Ended
from service.errors import BusyError, NotFoundError, StoreError
from service.fold import C, Fold, J, P, T
from service.job_runner import Runner
from service.store.holder import holder_name
from service.store.job_store import JobStore
from service.store.record import FINISHED, JobRecord, NewJob
from service.workers import Workers
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Jobs"]

_log = logging.getLogger("hybridtof")

_RENEW_S = 3.0
_SWEEP_EVERY = 600  # renewals


class Jobs(Generic[J, C, T, P]):
    """Runs posteriors of a store in one process.

    Parameters
    ----------
    fold : Fold
        The computation, such as the module `inference.posterior.fold`.
    store : JobStore
        Where jobs are kept between chunks.
    workers : Workers
        Where chunks run.
    running : int
        How many jobs run at a time; the others wait for their turn.
    look_s : float
        How often it is looked whether other processes have left or changed something [s].
    slice_s : float
        Processor time after which a job lets others have a turn, where any wait [s].

    Attributes
    ----------
    ended : Ended
        What posteriors that have ended leave.
    """

    def __init__(
        self,
        fold: Fold[J, C, T, P],
        store: JobStore,
        workers: Workers,
        running: int,
        look_s: float = 1.0,
        slice_s: float = 5.0,
    ) -> None:
        self._fold = fold
        self._store = store
        self._workers = workers
        self._running = running
        self._look_s = look_s
        self._version = f"{version('hybridtof')} {fold.FORMAT}"
        self._holder = holder_name()
        self._runner = Runner(
            fold, store, workers, self._version, self._announce, self._holder, slice_s
        )
        self.ended = Ended(fold, store, workers, self._version, self.get)
        self._tasks: list[asyncio.Task[None]] = []
        self._held: set[str] = set()
        self._news = asyncio.Event()
        self._open = False

    @property
    def open(self) -> bool:
        """Whether jobs are taken."""
        return self._open

    async def start(self) -> None:
        """Take jobs, first those that the store holds unfinished."""
        self._open = True
        loops = [self._serve() for _ in range(self._running)]
        self._tasks = [asyncio.create_task(loop) for loop in (*loops, self._hold())]

    async def close(self) -> None:
        """Stop between two instructions; what ran stays unfinished in the store."""
        self._open = False
        for task in self._tasks:
            task.cancel()
        # the processes are killed: a chunk is cheap to repeat, a shutdown must not wait for it
        await asyncio.to_thread(self._workers.shutdown, True, cancel_futures=True)
        await asyncio.gather(*self._tasks, return_exceptions=True)
        with contextlib.suppress(StoreError):  # the leases run out by themselves
            await asyncio.to_thread(self._store.release, self._holder)
        await asyncio.to_thread(self._store.close)

    async def submit(
        self,
        sensor: Sensor,
        scene: Scene,
        frames: Frames,
        settings: SamplerSettings,
        *,
        key: str | None = None,
        digest: str = "",
        client: str = "",
        job_id: str | None = None,
    ) -> JobRecord:
        """Prepare a job and let it run.

        Parameters
        ----------
        sensor, scene, frames
            What was asked.
        key, digest : str
            Idempotency key and a digest of the request.
        client : str
            To whom the job belongs.
        job_id : str, optional
            Its name; one that is there already is that job. Left out: a new one.

        Returns
        -------
        JobRecord
            Of the new job, or of the one that came with the same key before; it is in the store.

        Raises
        ------
        InvalidInputError, RefusedError
            Where `Fold.prepare` raises them.
        IdempotencyError
            Where the key came with another request.
        BusyError
            Where there is no room, or the service is ending.
        StoreError
            Where the store does not take it.
        """
        if not self._open:
            raise BusyError("the service is ending")
        job = await asyncio.to_thread(self._fold.prepare, sensor, scene, frames, settings)
        seed = job.settings.seed
        if seed is None:
            raise ValueError("`Fold.prepare` resolves the seed")
        new = NewJob(
            id=job_id or uuid.uuid4().hex,
            job=await asyncio.to_thread(job.to_bytes),
            format=self._version,
            method=job.settings.method,
            seed=seed,
            key=key,
            digest=digest,
            client=client,
        )
        kept = await asyncio.to_thread(self._store.add, new)
        self._announce()
        return kept

    async def get(self, job_id: str, client: str = "") -> JobRecord:
        """Return a job as it stands.

        Raises
        ------
        NotFoundError
            Where the client has none of that name.
        """
        record = await asyncio.to_thread(self._store.get, job_id)
        if record is None or record.client != client:
            raise NotFoundError("there is no posterior of this id")
        return record

    async def page(self, after: int | None, limit: int, client: str = "") -> list[JobRecord]:
        """Return jobs, newest first; see `JobStore.page`."""
        return await asyncio.to_thread(self._store.page, client, after, limit)

    async def follow(
        self, job_id: str, after: int = 0, client: str = ""
    ) -> AsyncIterator[JobRecord]:
        """Yield a job at every change that is noticed, until it has ended or was deleted.

        Parameters
        ----------
        job_id : str
            Which job.
        after : int
            Revision that is known already.
        client : str
            To whom it belongs.
        """
        while self._open:
            news = self._news
            try:
                record = await self.get(job_id, client)
            except NotFoundError:
                return
            if record.revision > after:
                after = record.revision
                yield record
            if record.status in FINISHED:
                return
            await self._wait(news)

    async def cancel(self, job_id: str, client: str = "") -> JobRecord:
        """End a job after the chunk that runs; one that has ended is left as it is.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        await self.get(job_id, client)
        record = await asyncio.to_thread(self._store.cancel, job_id)
        if record is None:
            raise NotFoundError("there is no posterior of this id")
        self._announce()
        return record

    async def delete(self, job_id: str, client: str = "") -> None:
        """Forget a job; if it runs, its last chunk is thrown away.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        await self.get(job_id, client)
        if not await asyncio.to_thread(self._store.delete, job_id):
            raise NotFoundError("there is no posterior of this id")
        self._announce()

    async def _serve(self) -> None:
        """Run one job after the other, a turn of each."""
        while self._open:
            news = self._news
            try:
                if await self._serve_one():
                    continue
            except StoreError as error:
                _log.warning("%s", error)
            except Exception:
                _log.exception("a posterior was left as it is")
            await self._wait(news)

    async def _serve_one(self) -> bool:
        """Run a job that nobody holds, for a turn; whether there was one."""
        claimed = await asyncio.to_thread(self._store.claim, self._holder)
        if claimed is None:
            return False
        self._held.add(claimed.record.id)
        try:
            await self._runner.run(claimed)
        finally:
            self._held.discard(claimed.record.id)
        self._announce()
        return True

    async def _hold(self) -> None:
        """Go on holding what runs here, and from time to time forget what is too old."""
        turn = 0
        while self._open:
            try:
                if turn % _SWEEP_EVERY == 0:
                    await asyncio.to_thread(self._store.sweep)
                if self._held:
                    await asyncio.to_thread(self._store.renew, self._holder, tuple(self._held))
            except StoreError as error:
                _log.warning("%s", error)
            turn += 1
            await asyncio.sleep(_RENEW_S)

    def _announce(self) -> None:
        """Wake whoever waits for news."""
        self._news.set()
        self._news = asyncio.Event()

    async def _wait(self, news: asyncio.Event) -> None:
        """Return when something has changed here, or may have elsewhere."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._look_s):
                await news.wait()
