"""Calibrations of streams: posteriors of the job store, asked for once and waited for.

What is asked stands in the stream's row, and the posterior's id follows from the stream's and the
calibration's number: a service that is started again finds the one that it had asked for.
"""

import asyncio
import contextlib
import dataclasses
import logging
import uuid
from typing import Any

import orjson

from inference.self_calibration.calibration import Asked, Outcome, outcome_of, sampler_of
from inference.self_calibration.plan import Plan
from service.caps import capped
from service.errors import BusyError, NotFoundError, StoreError
from service.jobs import Jobs
from service.service_settings import ServiceSettings
from service.store.record import FINISHED, JobRecord
from simulator.errors import HybridTofError
from simulator.scene import Scene, parse_scene

__all__ = ["Calibrations", "posterior_id"]

_log = logging.getLogger("hybridtof")

_AGAIN_S = 1.0
_NAMES = uuid.UUID("2f1f3d3e-5f0c-4b5e-9a43-5d1f0a6b7c11")  # any; never to be changed


def posterior_id(stream_id: str, number: int) -> str:
    """Return the id of the posterior behind a calibration."""
    return uuid.uuid5(_NAMES, f"{stream_id} {number}").hex


@dataclasses.dataclass(eq=False)
class _Running:
    number: int
    task: asyncio.Task[Outcome]


class Calibrations:
    """Sees to the calibrations that the streams of one process ask for, one of each at a time.

    Parameters
    ----------
    jobs : Jobs
        Where posteriors run.
    settings : ServiceSettings
        With the caps.
    """

    def __init__(self, jobs: Jobs[Any, Any, Any, Any], settings: ServiceSettings) -> None:
        self._jobs = jobs
        self._settings = settings
        self._running: dict[str, _Running] = {}
        self._closed = False

    def outcome(self, stream_id: str, client: str, plan: Plan, asked: Asked) -> Outcome | None:
        """Return what became of a calibration; None as long as it is under way.

        Parameters
        ----------
        stream_id, client : str
            Which stream, and whose.
        plan, asked : Plan, Asked
            What it asks for.
        """
        running = self._running.get(stream_id)
        if running is None or running.number != asked.number:
            self.forget(stream_id)
            posterior = posterior_id(stream_id, asked.number)
            task = asyncio.create_task(self._computed(posterior, client, plan, asked))
            running = self._running[stream_id] = _Running(asked.number, task)
        if not running.task.done():
            return None
        if running.task.cancelled() or running.task.exception() is not None:
            del self._running[stream_id]  # it was said in the log; once more
            return None
        return running.task.result()

    def forget(self, stream_id: str) -> None:
        """Wait no longer for what a stream asked for."""
        running = self._running.pop(stream_id, None)
        if running is not None:
            running.task.cancel()

    async def close(self) -> None:
        """Wait for nothing any more; posteriors stay in their store."""
        self._closed = True
        tasks = [running.task for running in self._running.values()]
        self._running.clear()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _computed(self, posterior: str, client: str, plan: Plan, asked: Asked) -> Outcome:
        try:
            return await self._outcome(posterior, client, plan, asked)
        except asyncio.CancelledError:
            # nobody waits for it any more: the stream asks for another one, or is gone. A service
            # that ends is no such reason: the next one goes on
            if not self._closed:
                with contextlib.suppress(HybridTofError):
                    await self._jobs.cancel(posterior, client)
            raise
        except Exception:
            _log.exception("calibration %s failed", posterior)
            raise

    async def _outcome(self, posterior: str, client: str, plan: Plan, asked: Asked) -> Outcome:
        try:
            record = await self._ended(posterior, client, plan, asked)
        except (BusyError, StoreError):
            raise
        except HybridTofError as error:
            return Outcome(None, f"there is no posterior: {error}")
        if record.status != "done" or record.result is None:
            return Outcome(None, f"the posterior was {record.status}")
        scene = await self._scene(record, client)
        return outcome_of(record.result, scene)

    async def _ended(self, posterior: str, client: str, plan: Plan, asked: Asked) -> JobRecord:
        """Return the posterior when it has ended, asking for it where it is not there."""
        sampler = capped(self._settings, sampler_of(asked).model_copy())
        while True:
            try:
                async for record in self._jobs.follow(posterior, client=client):
                    if record.status in FINISHED:
                        return record
                await self._jobs.submit(
                    plan.sensor,
                    asked.scene,
                    asked.frames,
                    sampler,
                    job_id=posterior,
                    client=client,
                )
            except (BusyError, StoreError) as error:
                _log.warning("calibration %s waits: %s", posterior, error)
                await asyncio.sleep(_AGAIN_S)

    async def _scene(self, record: JobRecord, client: str) -> Scene | None:
        if record.result is None or not record.result["drawn"]:
            return None
        try:
            document = await self._jobs.ended.scene(record.id, "", client)
        except NotFoundError:
            return None
        scene: Scene = parse_scene(orjson.loads(document)["scene"])
        return scene
