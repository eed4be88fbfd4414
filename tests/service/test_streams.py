"""Streams over a real socket."""

import asyncio
import contextlib
import json
import logging
import random
import socket
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import InvalidStatus

from benchmarks.postgres import postgres
from benchmarks.streams import lines_of, survived, system
from service.app import create_app
from service.border.keys import new_key, write_keys
from service.border.traces import Traces
from service.cli import main
from service.errors import BusyError, ConflictError, GoneError, NotFoundError
from service.service_settings import ServiceSettings
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
from tests.service import fake_fold
from tests.service.conftest import listening, speaking
from tests.service.test_store import Clock

pytestmark = pytest.mark.anyio

NDJSON = {"Content-Type": "application/x-ndjson"}
LINES = lines_of(12)
LIMITS: dict[str, Any] = {"workers": 1, "client_s": 1.0}


@pytest.fixture
async def address(tmp_path: Path) -> AsyncIterator[str]:
    limits = ServiceSettings(**LIMITS, database=f"sqlite:///{tmp_path}/s.sqlite")
    async with listening(create_app(limits, fake_fold)) as found:
        yield found


async def made(http: httpx.AsyncClient, **more: Any) -> str:
    response = await http.post("/v1/streams", json=system() | more)
    assert response.status_code == 201, response.text
    assert response.headers["Location"] == f"/v1/streams/{response.json()['id']}"
    return str(response.headers["Location"])


async def sent(http: httpx.AsyncClient, path: str, *lines: bytes) -> list[dict[str, Any]]:
    body = b"\n".join(lines)
    response = await http.post(path + "/frames", content=body, headers=NDJSON)
    assert response.status_code == 200, response.text
    assert response.headers["Content-Type"] == "application/x-ndjson"
    return [json.loads(line) for line in response.text.splitlines()]


def plain(answers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{k: v for k, v in answer.items() if k != "latency_s"} for answer in answers]


async def test_the_way_of_a_stream(address: str, tmp_path: Path, capsys: Any) -> None:
    async with speaking(f"http://{address}") as http:
        path = await made(http)
        answers = await sent(http, path, *LINES)
        assert [answer["sequence"] for answer in answers] == list(range(1, 13))
        assert answers[-1]["status"] == "unique"
        assert await sent(http, path, *LINES[3:9]) == answers[3:9]
        stands = (await http.get(path)).json()
        assert (stands["status"], stands["sequence"], stands["answered"]) == ("tracking", 12, 12)
        assert stands["last"] == answers[-1]
        listed = (await http.get("/v1/streams")).json()
        assert listed == {"items": [stands], "next_cursor": None}
        # in other batches, by WebSocket and on the command line the same, to the last bit
        cut = await made(http)
        pieces = [await sent(http, cut, *LINES[a:b]) for a, b in ((0, 1), (1, 2), (2, 7), (7, 12))]
        assert plain([answer for piece in pieces for answer in piece]) == plain(answers)
        live = await made(http)
        async with websockets.connect(f"ws://{address}{live}/live") as socket_:
            for line in LINES[:6]:
                await socket_.send(line.decode())
            await socket_.send(b"\n".join(LINES[6:]).decode())
            said = [json.loads(await socket_.recv()) for _ in LINES]
            assert plain(said) == plain(answers)
            second = await http.post(live + "/frames", content=b"{}", headers=NDJSON)
            assert second.status_code == 409
        events = []
        async with http.stream("GET", path + "/events") as response:
            async for told in response.aiter_lines():
                events.append(told)
                if told.startswith("id:"):
                    break
        assert json.loads(events[0].removeprefix("data:")) == stands
        assert (await http.delete(path)).status_code == 204
        assert (await http.get(path)).status_code == 404
        gone = await http.post(path + "/frames", content=b"{}", headers=NDJSON)
        assert gone.status_code == 404
        counts = (await http.get("/metrics")).text
    assert 'hybridtof_stream_lines_total{outcome="answered"} 36.0' in counts
    assert 'hybridtof_stream_lines_total{outcome="repeated"} 6.0' in counts
    frames, scene = tmp_path / "f.ndjson", tmp_path / "s.json"
    frames.write_bytes(b"\n".join(LINES))
    scene.write_text(json.dumps(system()))
    await asyncio.to_thread(main, ["track", str(frames), "--scene", str(scene)])
    out = capsys.readouterr().out.splitlines()
    assert plain([json.loads(line) for line in out]) == plain(answers)


async def test_a_websocket_is_told_of(address: str, caplog: pytest.LogCaptureFixture) -> None:
    """One that was answered and one that was refused: a line and a count of each, and no error."""
    caplog.set_level(logging.INFO)
    async with speaking(f"http://{address}") as http:
        path = await made(http)
        for name in (path, "/v1/streams/none"):
            with contextlib.suppress(InvalidStatus):
                async with websockets.connect(f"ws://{address}{name}/live") as socket_:
                    await socket_.send(LINES[0].decode())
                    await socket_.recv()
        while "hybridtof_requests_open 1.0" not in (await http.get("/metrics")).text:
            await asyncio.sleep(0.005)
        counts = (await http.get("/metrics")).text
    for status in (101, 404):
        route = "/v1/streams/{stream_id}/live"
        assert f"GET {route} {status}" in caplog.messages
        same = f'{{method="GET",route="{route}",status="{status}"}}'
        assert f"hybridtof_requests_total{same} 1.0" in counts
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


async def test_bad_requests(address: str) -> None:
    async with speaking(f"http://{address}") as http:
        for body, pointer in (
            (system() | {"policy": "some"}, "/policy"),
            (system() | {"tracking": {"hypotheses": 0}}, "/tracking/hypotheses"),
            (system() | {"tracking": {"observables": "derivatives"}}, "/sensor/noise/derivative"),
            ({"sensor": system()["sensor"]}, "/scene"),
        ):
            answer = await http.post("/v1/streams", json=body)
            assert answer.status_code == 422
            assert answer.json()["errors"][0]["pointer"] == pointer
        unknown = await http.post("/v1/streams", json=system() | {"scene": {}})
        assert unknown.json()["type"].endswith("refused")
        path = await made(http)
        odd = await http.post(path + "/frames", content=b"{}", headers={"Content-Type": "text/csv"})
        assert (odd.status_code, odd.headers["Accept"]) == (415, "application/x-ndjson")
        assert (await http.get("/v1/streams?cursor=x")).status_code == 400
        assert await sent(http, path) == []
        with pytest.raises(InvalidStatus) as refused:
            await websockets.connect(f"ws://{address}/v1/streams/none/live")
        assert refused.value.response.status_code == 404


async def test_the_stream_outlives_junk(address: str) -> None:
    long = b"x" * 20_000_000

    async def body() -> AsyncIterator[bytes]:
        yield LINES[0] + b"\n\x00\xff\xfe\n\n{\n"
        for start in range(0, len(long), 2**20):
            yield long[start : start + 2**20]
        yield b"\n" + LINES[0].replace(b'"sequence": 1', b'"sequence": 5') + b"\n"
        yield LINES[5] + b"\r\n" + LINES[6]

    async with speaking(f"http://{address}") as http:
        path = await made(http)
        response = await http.post(path + "/frames", content=body(), headers=NDJSON)
        found = [json.loads(line) for line in response.text.splitlines()]
        errors = [answer.get("error", {}).get("type", "").rpartition(":")[2] for answer in found]
        assert errors == ["", "malformed", "malformed", "too-large", "invalid-input", "", ""]
        assert found[4]["error"]["pointer"] == "/time_s"
        stands = (await http.get(path)).json()
        assert (stands["answered"], stands["errors"]) == (3, 4)
        # what breaks off has no last line
        host, _, port = address.rpartition(":")
        _, writer = await asyncio.open_connection(host, int(port))
        head = (f"POST {path}/frames HTTP/1.1", f"Host: {address}",
                "Content-Type: application/x-ndjson", "Transfer-Encoding: chunked")  # fmt: skip
        part = LINES[7] + b"\n" + LINES[8]
        writer.write("\r\n".join([*head, "", ""]).encode())
        writer.write(f"{len(part):x}\r\n".encode() + part + b"\r\n")
        while (await http.get(path)).json()["sequence"] != 8:
            await asyncio.sleep(0.01)
        writer.transport.abort()
        while (response := await http.post(path + "/frames", content=LINES[8],
                                           headers=NDJSON)).status_code == 409:  # fmt: skip
            await asyncio.sleep(0.01)
        assert json.loads(response.text)["sequence"] == 9
        assert "error" not in json.loads(response.text)
        # junk by itself is counted, and leaves its number to a line that states it
        (junk,) = await sent(http, path, b"junk")
        (good,) = await sent(http, path, LINES[9])
        assert (junk["sequence"], good["sequence"], "error" in good) == (10, 10, False)
        stands = (await http.get(path)).json()
        assert (stands["sequence"], stands["answered"], stands["errors"]) == (10, 6, 5)


async def test_streams_belong_to_keys(tmp_path: Path) -> None:
    file = tmp_path / "keys.json"
    made_keys = [new_key(name) for name in ("a", "b")]
    write_keys(file, tuple(key for key, _ in made_keys))
    limits = ServiceSettings(**LIMITS, api_keys=file, database=f"sqlite:///{tmp_path}/s.sqlite",
                             max_streams=4)  # fmt: skip
    async with listening(create_app(limits, fake_fold)) as address:
        own, other = ({"Authorization": f"Bearer {secret}"} for _, secret in made_keys)
        async with (
            speaking(f"http://{address}", own) as mine,
            speaking(f"http://{address}", other) as theirs,
        ):
            path = await made(mine)
            assert (await theirs.get(path)).status_code == 404
            assert (await theirs.delete(path)).status_code == 404
            assert (await theirs.get("/v1/streams")).json()["items"] == []
            stolen = await theirs.post(path + "/frames", content=LINES[0], headers=NDJSON)
            assert stolen.status_code == 404
            for headers, status in ((other, 404), ({}, 401)):
                with pytest.raises(InvalidStatus) as refused:
                    await websockets.connect(
                        f"ws://{address}{path}/live", additional_headers=headers
                    )
                assert refused.value.response.status_code == status
            await made(mine)
            third = await mine.post("/v1/streams", json=system())
            assert third.status_code == 503
            await made(theirs)


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


async def flood(address: str, path: str, http: httpx.AsyncClient) -> tuple[int, dict[str, Any]]:
    """Send without reading until nothing more is taken, or the service hangs up."""
    data = b"\n".join(lines_of(60_000)) + b"\n"
    host, _, port = address.rpartition(":")
    taken = 0
    with socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.setblocking(False)
        loop = asyncio.get_running_loop()
        await loop.sock_connect(deaf, (host, int(port)))
        head = (f"POST {path}/frames HTTP/1.1", f"Host: {address}",
                "Content-Type: application/x-ndjson", "Transfer-Encoding: chunked")  # fmt: skip
        await loop.sock_sendall(deaf, "\r\n".join([*head, "", ""]).encode())
        with contextlib.suppress(OSError, TimeoutError):
            for start in range(0, len(data), 2**14):
                part = data[start : start + 2**14]
                async with asyncio.timeout(5):
                    chunk = f"{len(part):x}\r\n".encode() + part + b"\r\n"
                    await loop.sock_sendall(deaf, chunk)
                taken += len(part)
        assert (await http.get("/health/live")).status_code == 200
    while (await http.post(path + "/frames", content=b"", headers=NDJSON)).status_code == 409:
        await asyncio.sleep(0.01)
    return taken, (await http.get(path)).json()


@pytest.mark.slow
async def test_who_does_not_read_has_to_wait(address: str) -> None:
    """Nothing is dropped, and no more is taken than buffers hold."""
    async with speaking(f"http://{address}") as http:
        _, stands = await flood(address, await made(http), http)
        assert stands["dropped"] == 0
        # 60,000 lines were to be sent; answers have 400 bytes, buffers some MB
        assert 0 < stands["answered"] < 50_000


async def test_the_latest_is_not_kept_waiting(address: str) -> None:
    """A client that does not read while it sends: old lines go, the newest is answered."""
    async with speaking(f"http://{address}") as http:
        path = await made(http, policy="latest")
        many = lines_of(3000)
        found = await sent(http, path, *many)  # all at once: more than there is room for
        stands = (await http.get(path)).json()
    assert found[-1]["sequence"] == 3000
    assert stands["dropped"] == sum(answer.get("dropped", 0) for answer in found) > 0
    assert stands["dropped"] + stands["answered"] == 3000
    assert stands["gaps"] == 0


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
