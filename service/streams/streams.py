"""Streams of one process: made, watched, sent to, forgotten."""

import asyncio
import contextlib
import uuid
import weakref
from collections import OrderedDict
from collections.abc import AsyncIterator

import anyio

from inference.tracking.state import TrackState
from service.border.traces import Traces
from service.errors import ConflictError, GoneError, NotFoundError, StoreError
from service.store.holder import has_ended, holder_name
from service.store.stream_record import StreamRecord
from service.store.stream_store import StreamStore
from service.streams.calibrations import Calibrations
from service.streams.followers import Follower
from service.streams.lines import Place
from service.streams.model import model_of, request_of, seeded
from service.streams.producer import Producer, place_of
from service.streams.writer import Writer

__all__ = ["Streams"]

_LOOK_S = 1.0
_TOGETHER_S = 0.1
# how long a client that has hung up takes to be gone: the next is often the same one
_LEAVING_S = 0.5
_REMEMBERED = 256


class Streams:
    """Opens streams of a store for one client each.

    Parameters
    ----------
    store : StreamStore
        Where they are kept.
    traces : Traces
        Counts lines.
    threads : int
        How many track at a time.
    calibrations : Calibrations, optional
        Where streams ask for them.
    """

    def __init__(
        self,
        store: StreamStore,
        traces: Traces,
        threads: int,
        calibrations: Calibrations | None = None,
    ) -> None:
        self._store = store
        self._calibrations = calibrations
        self._traces = traces
        self._threads = threads
        self._writer = Writer(store)
        self._holder = holder_name()
        # streams that somebody sends to, and what tells that nobody does any more
        self._producing: dict[str, asyncio.Event] = {}
        # held by those who wait alone
        self._watched: weakref.WeakValueDictionary[str, asyncio.Event] = (
            weakref.WeakValueDictionary()
        )
        # where streams stood when their last client was done
        self._places: OrderedDict[str, tuple[StreamRecord, Place, Follower]] = OrderedDict()
        self._limiter: anyio.CapacityLimiter | None = None

    async def create(self, raw: bytes, client: str) -> StreamRecord:
        """Make a stream.

        Parameters
        ----------
        raw : bytes
            The request, which was validated.
        client : str
            To whom it belongs.

        Raises
        ------
        InvalidInputError, RefusedError
            Where there is no tracker for it.
        BusyError
            Where there is no room.
        """
        raw = seeded(raw)
        model = await asyncio.to_thread(model_of, raw)
        state = model.to_bytes(model.first)
        told = model.told(model.first)
        counts = {} if told is None else {"calibration": told}
        name = uuid.uuid4().hex
        return await asyncio.to_thread(self._store.add, name, client, raw, state, counts)

    async def get(self, stream_id: str, client: str) -> StreamRecord:
        """Return a stream as it stands.

        Raises
        ------
        NotFoundError
            Where the client has none of that name.
        """
        record = await asyncio.to_thread(self._store.get, stream_id)
        if record is None or record.client != client:
            raise NotFoundError("there is no stream of this id")
        return record

    def status(self, record: StreamRecord) -> str:
        """Return what a stream is doing."""
        if self._store.expired(record):
            return "expired"
        calibration = record.counts.get("calibration")
        return "tracking" if calibration is None or calibration["known"] else "calibrating"

    async def page(self, after: int | None, limit: int, client: str) -> list[StreamRecord]:
        """Return streams, newest first; see `StreamStore.page`."""
        return await asyncio.to_thread(self._store.page, client, after, limit)

    async def delete(self, stream_id: str, client: str) -> None:
        """Forget a stream.

        Raises
        ------
        NotFoundError
            Where there is none of that name.
        """
        await self.get(stream_id, client)
        if not await asyncio.to_thread(self._store.delete, stream_id):
            raise NotFoundError("there is no stream of this id")
        self._places.pop(stream_id, None)
        if self._calibrations is not None:
            self._calibrations.forget(stream_id)
        self._announce(stream_id)

    async def close(self) -> None:
        """Wait for no calibration any more."""
        if self._calibrations is not None:
            await self._calibrations.close()

    async def follow(self, stream_id: str, after: int, client: str) -> AsyncIterator[StreamRecord]:
        """Yield a stream as it stands after changes, those in quick succession as one.

        Parameters
        ----------
        stream_id : str
            Which stream.
        after : int
            Number of the last change that is known already.
        client : str
            To whom it belongs.
        """
        while True:
            news = self._watched.setdefault(stream_id, asyncio.Event())
            try:
                record = await self.get(stream_id, client)
            except NotFoundError:
                return
            if record.number > after:
                after = record.number
                yield record
            if self.status(record) == "expired":
                return
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LOOK_S):
                    await news.wait()
            await asyncio.sleep(_TOGETHER_S)

    def _announce(self, stream_id: str) -> None:
        if (news := self._watched.pop(stream_id, None)) is not None:
            news.set()

    @contextlib.asynccontextmanager
    async def producing(
        self, stream_id: str, client: str, quiet_s: float | None = None, lasting: bool = True
    ) -> AsyncIterator[Producer]:
        """Open a stream for a client that sends to it; no other may meanwhile.

        Parameters
        ----------
        stream_id, client : str
            Which stream, and whose.
        quiet_s : float or None
            How long the client may send nothing [s].
        lasting : bool
            Whether it goes on sending: other processes then keep away from the stream.

        Raises
        ------
        NotFoundError
            Where the client has none of that name.
        ConflictError
            Where another client sends to it.
        GoneError
            Where it has expired, or its state is of another version.
        """
        await self._left(stream_id)
        known = None if lasting else self._remembered(stream_id, client)
        record = known or await self.get(stream_id, client)
        if self._store.expired(record):
            raise GoneError("the stream has expired: make a new one")
        if stream_id in self._producing or self._held_elsewhere(record):
            raise ConflictError("another client sends to this stream")
        self._producing[stream_id] = asyncio.Event()
        self._traces.producers.inc()
        if self._limiter is None:
            self._limiter = anyio.CapacityLimiter(self._threads)
        try:
            place, model = await self._standing(record)
            producer = Producer(
                store=self._store,
                writer=self._writer,
                limiter=self._limiter,
                traces=self._traces,
                record=record,
                model=model,
                place=place,
                latest=request_of(record.request).policy == "latest",
                holder=self._holder if lasting else None,
                held_elsewhere=self._held_elsewhere,
                changed=lambda: self._announce(stream_id),
                quiet_s=quiet_s,
                calibrations=self._calibrations,
                seen=known is None,
            )
            try:
                yield producer
            finally:
                self._remember(producer)
                if lasting:
                    with contextlib.suppress(StoreError):  # the lease runs out by itself
                        await asyncio.to_thread(self._store.release, stream_id, self._holder)
        finally:
            self._producing.pop(stream_id).set()
            self._traces.producers.dec()

    async def _left(self, stream_id: str) -> None:
        """Wait a moment for a client that is about to be gone."""
        if (leaving := self._producing.get(stream_id)) is not None:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LEAVING_S):
                    await leaving.wait()

    def _remembered(self, stream_id: str, client: str) -> StreamRecord | None:
        """Return the record of a stream as it stood here, where it need not be read again.

        Should it stand elsewhere by now its next change is not taken, and it is read then.
        """
        record = self._places[stream_id][0] if stream_id in self._places else None
        if record is None or record.client != client or self._store.expired(record):
            return None
        return record

    async def _standing(self, record: StreamRecord) -> tuple[Place, Follower]:
        """Return where a stream stands, and what follows it.

        Reading a state takes as long as some frames, and so does going to another thread.
        """
        known, place, model = self._places.pop(record.id, (None, None, None))
        if model is None:
            model = await asyncio.to_thread(model_of, record.request)
        if place is None or known is None or known.number != record.number:
            place = place_of(record, model)
        return place, model

    def _remember(self, producer: Producer) -> None:
        # others have histories, and are large
        if isinstance(producer.place.state, TrackState):
            record = producer.record
            self._places[record.id] = record, producer.place, producer.model
            while len(self._places) > _REMEMBERED:
                self._places.popitem(last=False)

    def _held_elsewhere(self, record: StreamRecord) -> bool:
        if record.holder in (None, self._holder) or not self._store.held(record):
            return False
        return not has_ended(record.holder)
