"""What a posterior that has ended leaves: its draws as a file, and a scene that knows them.

Both are made anew from its last checkpoint, in a worker.
"""

import asyncio
import functools
from collections.abc import Awaitable, Callable
from typing import Generic

from service.errors import BusyError, ConflictError, GoneError, NotFoundError
from service.exports.scene import findings_of, write_scene
from service.exports.writing import write_draws, write_file
from service.fold import C, Fold, J, P, T
from service.store.job_store import JobStore
from service.store.record import FINISHED, JobRecord
from service.workers import Workers

__all__ = ["Ended"]

_DRAWS_LIMIT_S = 600.0
_MOST_DRAWING = 16


class Ended(Generic[J, C, T, P]):
    """Makes files of posteriors that have ended.

    Parameters
    ----------
    fold : Fold
        The computation.
    store : JobStore
        Where jobs are kept.
    workers : Workers
        Where files are made.
    version : str
        Of the form that this process reads.
    get : callable
        (job id, client) -> the job as it stands; `NotFoundError` where the client has none.
    """

    def __init__(
        self,
        fold: Fold[J, C, T, P],
        store: JobStore,
        workers: Workers,
        version: str,
        get: Callable[[str, str], Awaitable[JobRecord]],
    ) -> None:
        self._fold = fold
        self._store = store
        self._workers = workers
        self._version = version
        self._get = get
        self._drawing = 0

    async def draws(self, job_id: str, media_type: str, client: str = "") -> bytes:
        """Return the draws of a job that has ended, made anew from its last checkpoint.

        Parameters
        ----------
        job_id : str
            Which job.
        media_type : str
            Of one of `service.exports.EXPORTS`.
        client : str
            To whom it belongs.

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
        BusyError
            Where too many are being made.
        GoneError
            Where the draws had to make room for others, or were made by another version.
        """
        record = await self._ended(job_id, client)
        return await self._written(record, functools.partial(write_file, media_type))

    async def scene(
        self, job_id: str, date: str, client: str = "", other_objects: bool = False
    ) -> bytes:
        """Return a job that has ended as a document of sensor and scene, made from its draws.

        Parameters
        ----------
        job_id : str
            Which job.
        date : str
            To be written into it.
        client : str
            To whom it belongs.
        other_objects : bool
            Whether it is to be used for other objects.

        Returns
        -------
        bytes
            JSON; for what is raised see `draws`.
        """
        record = await self._ended(job_id, client)
        findings = findings_of(record.result or {}, record.seed, date)
        return await self._written(record, functools.partial(write_scene, findings, other_objects))

    async def _ended(self, job_id: str, client: str) -> JobRecord:
        """Return a job that has draws."""
        record = await self._get(job_id, client)
        if record.status not in FINISHED:
            raise ConflictError("the posterior is not finished: wait for it, or cancel it")
        if record.result is None or not record.result["drawn"]:
            raise ConflictError("this posterior ended before anything was drawn")
        return record

    async def _written(self, record: JobRecord, write: Callable[..., bytes]) -> bytes:
        """Return what a worker makes of the draws of a job."""
        kept = await asyncio.to_thread(self._store.drawn, record.id)
        if kept is None:
            raise NotFoundError("there is no posterior of this id")
        if not kept.pieces or record.format != self._version:
            reason = "made room for those of other posteriors"
            if kept.pieces:
                reason = "are in the form of another version of hybridtof"
            raise GoneError(f"the draws {reason}; ask again with the same seed")
        if self._drawing >= _MOST_DRAWING:
            raise BusyError("too many requests for draws wait for their turn")
        call = write_draws, self._fold.Job.from_bytes, self._fold.Checkpoint.from_bytes
        future = self._workers.submit_within(
            _DRAWS_LIMIT_S, *call, self._fold.draw, write, kept.job, kept.pieces
        )
        self._drawing += 1
        try:
            return await asyncio.wrap_future(future)
        finally:
            self._drawing -= 1
            if not future.done():
                self._workers.abandon(future)
