"""Streams in the store, by several processes, and after a killed worker."""

import contextlib
import json
import random
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocketDisconnect

from benchmarks.postgres import postgres
from benchmarks.streams import lines_of, survived, system
from service.border.traces import Traces
from service.errors import BusyError, ConflictError, GoneError, NotFoundError
from service.store.stream_record import StreamChange, StreamRecord
from service.store.stream_store import StreamStore
from service.store.transactions import Transactions
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Line, Place
from service.streams.model import model_of
from service.streams.producer import lines_of as cut_lines
from service.streams.producer import place_of
from service.streams.streams import Streams
from service.streams.taking import take
from tests.service.streaming import LINES, plain
from tests.service.test_store import Clock

pytestmark = pytest.mark.anyio


async def test_who_breaks_off_leaves_the_stream_to_others(store: StreamStore) -> None:
    """Whichever process its next connection comes to."""
    one, other = (Streams(store, Traces(dict), 1) for _ in range(2))
    made_one = await one.create(json.dumps(system()).encode(), "")

    async def chunks() -> AsyncIterator[bytes]:
        yield LINES[0] + b"\n"

    async def away(_: bytes) -> None:
        with pytest.raises(ConflictError):
            async with other.producing(made_one.id, ""):
                pass
        raise WebSocketDisconnect

    with pytest.raises(WebSocketDisconnect):
        async with one.producing(made_one.id, "") as producer:
            await producer.run(cut_lines(chunks()), away)
    async with other.producing(made_one.id, "") as producer:
        assert producer.place.sequence == 1


async def test_batches_by_two_processes_are_one_stream(
    store: StreamStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process need not read what it wrote, and sees what another one wrote or deleted."""
    one, other = (Streams(store, Traces(dict), 1) for _ in range(2))
    stream_id = (await one.create(json.dumps(system()).encode(), "")).id
    reads, get = [], store.get

    def counted(name: str) -> StreamRecord | None:
        reads.append(name)
        return get(name)

    monkeypatch.setattr(store, "get", counted)

    async def batch(streams: Streams, lines: list[bytes]) -> list[dict[str, Any]]:
        answers: list[bytes] = []

        async def whole() -> AsyncIterator[bytes]:
            yield b"\n".join(lines)

        async def send(body: bytes) -> None:
            answers.append(body)

        async with streams.producing(stream_id, "", lasting=False) as producer:
            await producer.run(cut_lines(whole()), send)
        return plain([json.loads(line) for line in b"".join(answers).splitlines()])

    found = await batch(one, LINES[:2]) + await batch(one, LINES[2:4])
    assert len(reads) == 1
    found += await batch(other, LINES[4:6]) + await batch(one, LINES[6:8])
    found += await batch(one, LINES[8:])
    assert len(reads) == 3
    model = model_of(json.dumps(system()).encode())
    lines = [Line(raw, 0.0) for raw in LINES]
    quiet = take(model, Place(model.first), lines, JsonLines(), Kept())
    assert found == plain([json.loads(answer) for answer in quiet.answers])
    assert await batch(one, LINES[8:10]) == found[8:10]
    await other.delete(stream_id, "")
    for lines_again in (LINES[8:10], lines_of(14)[12:]):
        with pytest.raises(NotFoundError):
            await batch(one, lines_again)


def change(record: StreamRecord, sequence: int, answers: bytes) -> StreamChange:
    return StreamChange(record.id, record.number, b"s", sequence, {}, b"{}", answers, None)


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.slow)])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[StreamStore]:
    with contextlib.ExitStack() as stack:
        found: str | None = f"sqlite:///{tmp_path}/s.sqlite"
        if request.param == "postgresql":
            found = stack.enter_context(postgres())
        if found is None:
            pytest.skip("no PostgreSQL server is installed")
        database = Transactions(found)
        stack.callback(database.close)
        yield StreamStore(database, 4, 10.0, 100.0, 8, Clock())


def test_after_an_upgrade_a_stream_is_gone_and_says_so(store: StreamStore) -> None:
    """The form of the tracker's state changes; nobody has sent a state that could be wrong."""
    request = json.dumps(system()).encode()
    model = model_of(request)
    assert place_of(store.add("a", "k", request, model.to_bytes(model.first)), model).sequence == -1
    with pytest.raises(GoneError, match="another version"):
        place_of(store.add("b", "k", request, b"a state in another form"), model)


def test_the_store(store: StreamStore) -> None:
    clock = store._clock
    assert isinstance(clock, Clock)
    first = store.add("a", "k", b"{}", b"state")
    # written where it was seen, and nowhere else; others are not held up by that
    other = store.add("b", "k", b"{}", b"state")
    batch = [change(first, 3, b"123"), change(first, 4, b"4"), change(other, 1, b"x")]
    assert store.apply(batch) == [True, False, True]
    after = store.get("a")
    assert after is not None
    assert (after.number, after.sequence, after.kept_bytes) == (first.number + 1, 3, 3)
    assert store.apply([change(first, 4, b"4")]) == [False]
    # of the answers those of the last numbers are kept, and no more than some bytes
    for sequence, answers in ((7, b"7"), (11, b"11"), (12, b"c")):
        record = store.get("a")
        assert record is not None
        assert store.apply([change(record, sequence, answers)]) == [True]
    assert b"".join(store.answers("a")) == b"711c"
    big = b"z" * 3 * 2**20
    for sequence in (13, 14):
        record = store.get("a")
        assert record is not None
        assert store.apply([change(record, sequence, big)]) == [True]
    record = store.get("a")
    assert record is not None
    assert len(b"".join(store.answers("a"))) == record.kept_bytes == len(big)
    # half of the room at most is one key's; what has expired makes room
    with pytest.raises(BusyError, match="2 streams of this key"):
        store.add("c", "k", b"{}", b"state")
    clock.now += 11.0
    assert store.expired(record)
    store.add("c", "k", b"{}", b"state")
    store.add("d", "", b"{}", b"state")
    store.add("e", "", b"{}", b"state")
    assert [store.get(name) is None for name in "abcde"] == [True, False, False, False, False]
    assert store.count() == 3
    assert [record.id for record in store.page("", None, 9)] == ["e", "d"]
    clock.now += 101.0
    store.add("f", "", b"{}", b"state")
    assert store.get("a") is None
    assert store.answers("a") == []
    assert store.delete("f")
    assert not store.delete("f")


@pytest.mark.slow
def test_kills_change_nothing(tmp_path: Path) -> None:
    """The long version is `python -m benchmarks.streams --kills 50`."""
    lines = [lines_of(200, seed=k) for k in range(2)]
    killed, kills = survived(f"sqlite:///{tmp_path}/s.sqlite", lines, 10, 2, random.Random(1))
    assert kills == 2
    model = model_of(json.dumps(system()).encode())
    for sent, found in zip(lines, killed, strict=True):
        quiet = take(model, Place(model.first), [Line(raw, 0.0) for raw in sent],
                     JsonLines(), Kept())  # fmt: skip
        assert found == plain([json.loads(answer) for answer in quiet.answers])
        assert [answer["sequence"] for answer in found] == list(range(1, 201))
