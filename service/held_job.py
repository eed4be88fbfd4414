"""A job in the store, as the process has it that holds it: written guarded, looked at again."""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from service.errors import StoreError
from service.store.job_store import JobStore
from service.store.record import JobRecord

__all__ = ["HeldJob", "LostError"]

_log = logging.getLogger("hybridtof")
_LONGEST_PAUSE_S = 5.0


class LostError(Exception):
    """The job was deleted, or another process is ahead with it: nothing is to be done here."""


class HeldJob:
    """The record of a job, kept in step with the store.

    Parameters
    ----------
    store : JobStore
        Where it is kept.
    record : JobRecord
        As it was claimed.
    announce : callable
        Is called when it has changed.
    """

    def __init__(self, store: JobStore, record: JobRecord, announce: Callable[[], None]) -> None:
        self._store = store
        self._announce = announce
        self.record = record

    async def save(self, write: Callable[..., JobRecord | None], *arguments: Any) -> None:
        """Write to the store, for as long as it takes: a chunk need not be computed twice.

        Raises
        ------
        LostError
            Where there is nothing to write to.
        """
        pause = 0.1
        while True:
            try:
                after = await asyncio.to_thread(write, *arguments)
            except StoreError as error:
                _log.warning("posterior %s waits: %s", self.record.id, error)
                await asyncio.sleep(pause)
                pause = min(2 * pause, _LONGEST_PAUSE_S)
                continue
            if after is None:
                raise LostError
            self.record = after
            self._announce()
            return

    async def tell(self, phase: str) -> None:
        """Change the phase that is told; how long it takes is known of no other phase."""
        if phase != self.record.progress["phase"]:
            progress = self.record.progress | {"phase": phase, "eta_s": None}
            await self.save(self._store.report, self.record, progress)

    async def look(self) -> bool:
        """Look at the job in the store; return whether it was cancelled.

        Raises
        ------
        LostError
            Where it is no longer ours.
        """
        try:
            seen = await asyncio.to_thread(self._store.get, self.record.id)
        except StoreError:
            return False
        if seen is None or seen.number != self.record.number or seen.status != "running":
            raise LostError
        self.record = seen
        return seen.cancel_requested
