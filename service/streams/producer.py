"""One client that sends lines to a stream, and is answered line by line, in order."""

import asyncio
import dataclasses
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from typing import Any

import anyio
import anyio.to_thread
from starlette.requests import ClientDisconnect

from inference.self_calibration.following import conclude, wanted
from inference.self_calibration.state import CalibrationState
from service.border.traces import Traces
from service.errors import ConflictError, GoneError, NotFoundError, SlowClientError
from service.store.stream_record import StreamChange, StreamRecord
from service.store.stream_store import StreamStore
from service.streams.answered import before_in
from service.streams.calibrations import Calibrations
from service.streams.cutting import Cutter
from service.streams.followers import Calibrating, Follower
from service.streams.forms import JsonLines
from service.streams.lines import COUNTS, Before, Place, Taken
from service.streams.model import model_of
from service.streams.room import Room
from service.streams.taking import take
from service.streams.writer import Writer
from simulator.compiled import while_compiling
from simulator.errors import InvalidInputError

__all__ = ["Producer", "lines_of", "place_of"]

_KEPT = (*COUNTS, "unnumbered", "surprise", "misfit", "calibration", "supposed", "early")
_BLOCK = 2**17  # of a batch of a thousand lines, which is to be one turn
_TRIES = 3

Send = Callable[[bytes], Awaitable[None]]


def place_of(record: StreamRecord, model: Follower) -> Place:
    """Return where a stream stands, from its row.

    Raises
    ------
    GoneError
        Where the state is of another version of the tracker.
    """
    try:
        state = model.from_bytes(record.state)
    except InvalidInputError:
        message = "the stream's state is of another version of hybridtof: make a new one"
        raise GoneError(message) from None
    return Place(state, record.sequence, last=record.last, **record.counts)


async def lines_of(chunks: AsyncIterator[bytes]) -> AsyncIterator[list[bytes | None]]:
    """Yield the lines of a body as they come; one that breaks off has no last line."""
    cutter = Cutter()
    async for chunk in chunks:
        for start in range(0, len(chunk), _BLOCK):
            yield cutter.feed(chunk[start : start + _BLOCK])
    yield cutter.end()


class _Stored:
    """Answers in the store, read when one of them is asked for."""

    def __init__(self, store: StreamStore, stream_id: str) -> None:
        self._store, self._id = store, stream_id
        self._answers: Mapping[int, Before] | None = None

    def answer(self, sequence: int) -> Before | None:
        """See `Earlier.answer`."""
        if self._answers is None:
            found: dict[int, Before] = {}
            for kept in self._store.answers(self._id):
                found.update(before_in(kept))
            self._answers = found
        return self._answers.get(sequence)


@dataclasses.dataclass
class Producer:
    """One client that sends to one stream.

    Attributes
    ----------
    store, writer : StreamStore, Writer
        Where the stream is kept.
    limiter : anyio.CapacityLimiter
        For threads that track.
    traces : Traces
        Counts lines.
    record : StreamRecord
        As the stream stood when it was opened.
    model, place : Follower, Place
        What follows it, and where it stands.
    latest : bool
        Whether stale lines are dropped.
    holder : str or None
        This process, where the client goes on sending.
    held_elsewhere : callable
        Tells of a record whether another process's client sends to the stream.
    changed : callable
        Is called after every change.
    quiet_s : float or None
        How long a client may send nothing [s].
    calibrations : Calibrations or None
        Where the stream asks for them.
    seen : bool
        Whether the record was read for this client. One that is remembered shows itself as the
        present one where a change of it is taken.
    """

    store: StreamStore
    writer: Writer
    limiter: anyio.CapacityLimiter
    traces: Traces
    record: StreamRecord
    model: Follower
    place: Place
    latest: bool
    holder: str | None
    held_elsewhere: Callable[[StreamRecord], bool]
    changed: Callable[[], None]
    quiet_s: float | None = None
    calibrations: Calibrations | None = None
    seen: bool = True

    async def run(self, source: AsyncIterator[list[bytes | None]], send: Send) -> None:
        """Answer all lines.

        Parameters
        ----------
        source : async iterator of lists of lines
            As `lines_of` yields them.
        send : callable
            Takes the answers of a turn, each with a line end; what came in the meantime waits.

        Raises
        ------
        NotFoundError, ConflictError
            Where the stream was deleted, or taken over by another client: what was not answered
            was not applied.
        SlowClientError
            Where the client sent nothing for too long.
        StoreError
            Where the store does not take an answer.
        """
        room = Room(self.latest)
        reading = asyncio.create_task(self._read(source, room))
        try:
            while lines := await room.take():
                taken = await self._turn(lines)
                await send(taken.text)
            await reading
        finally:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)

    async def _read(self, source: AsyncIterator[list[bytes | None]], room: Room) -> None:
        try:
            while True:
                try:
                    async with asyncio.timeout(self.quiet_s):
                        lines = await anext(source)
                except TimeoutError:
                    message = f"nothing came for {self.quiet_s:g} s"
                    raise SlowClientError(message) from None
                await room.put(lines)
        except (StopAsyncIteration, ClientDisconnect):
            pass  # what came before the client hung up has its turn still
        finally:
            room.end()

    async def _turn(self, lines: list[Any]) -> Taken:
        """Answer some lines, once what they change is kept."""
        for _ in range(_TRIES):
            place = self._concluded()
            taken, change = await anyio.to_thread.run_sync(
                self._taken, place, lines, limiter=self.limiter
            )
            # what came before is answered from the store, by a stream that is there
            done = await self.writer.write(change) if taken.changed else self.seen
            if done:
                self.seen = True
                self._count(taken)
                self._concluded()  # what is asked for from now on begins at once
                return taken
            await asyncio.to_thread(self._reload)
        raise ConflictError("another client sends to this stream")

    def _concluded(self) -> Place:
        """Return where the stream stands, with the calibration that it waits for, where there is.

        It applies from the next number on, and is kept with what is answered there.
        """
        model, place = self.model, self.place
        if self.calibrations is None or not isinstance(model, Calibrating):
            return place
        state = place.state
        if not isinstance(state, CalibrationState) or (asked := wanted(state)) is None:
            return place
        record = self.record
        outcome = self.calibrations.outcome(record.id, record.client, model.plan, asked)
        if outcome is None:
            return place
        applies_at = max(asked.decided_at, place.sequence) + 1
        return dataclasses.replace(place, state=conclude(state, outcome, applies_at))

    def _taken(self, place: Place, lines: list[Any]) -> tuple[Taken, StreamChange]:
        earlier = _Stored(self.store, self.record.id)
        with while_compiling():  # no line waits for that
            taken = take(self.model, place, lines, JsonLines(), earlier)
        place = taken.place
        change = StreamChange(
            self.record.id,
            self.record.number,
            self.model.to_bytes(place.state) if taken.changed else b"",
            place.sequence,
            {name: getattr(place, name) for name in _KEPT},
            place.last,
            taken.kept,
            self.holder,
        )
        return taken, change

    def _reload(self) -> None:
        """See where the stream stands by now, if it does.

        A change of this client's may have been kept after its connection broke, or the stream
        belongs to somebody else's client by now.
        """
        record = self.store.get(self.record.id)
        if record is None:
            raise NotFoundError("the stream was deleted")
        if self.held_elsewhere(record):
            raise ConflictError("another client sends to this stream")
        self.record, self.seen = record, True
        self.model = model_of(record.request)
        self.place = place_of(record, self.model)

    def _count(self, taken: Taken) -> None:
        before, self.place = self.place, taken.place
        if taken.changed:
            self.record = dataclasses.replace(self.record, number=self.record.number + 1)
            self.changed()
        lines = self.traces.lines
        for name in ("answered", "errors", "dropped"):
            lines.labels(name).inc(getattr(taken.place, name) - getattr(before, name))
        lines.labels("repeated").inc(taken.repeated)
