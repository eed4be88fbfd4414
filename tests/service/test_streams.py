"""Streams over a real socket."""

import asyncio
import contextlib
import json
import logging
import socket
import threading
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from websockets.exceptions import InvalidStatus

from benchmarks.streams import lines_of, system
from inference.tracking import track
from service.app import create_app
from service.border.keys import new_key, write_keys
from service.cli import main
from service.service_settings import ServiceSettings
from service.store.stream_store import StreamStore
from simulator import compiling_cost
from simulator.compiled import Kernel
from tests.service import fake_fold
from tests.service.conftest import listening, speaking
from tests.service.streaming import LINES, NDJSON, plain, sent

pytestmark = pytest.mark.anyio

LIMITS: dict[str, Any] = {"workers": 1, "client_s": 1.0}
WAIT_S = 300.0  # for what comes in milliseconds


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
        async with asyncio.timeout(WAIT_S):
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


async def test_no_line_waits_for_a_compiler(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """After some hundred lines one waited for 14.5 s, where the service was not warm."""
    kernel = Kernel(track.run_filter.__wrapped__, for_both=False)  # type: ignore[attr-defined]
    monkeypatch.setattr(kernel, "_folder", None)
    monkeypatch.setattr(track, "run_filter", kernel)
    monkeypatch.setattr(compiling_cost, "make_s", lambda *_: 60.0)
    asked, free = threading.Event(), threading.Event()

    def compile_(_: object) -> None:
        asked.set()
        free.wait()

    monkeypatch.setattr(kernel, "make", compile_)
    try:
        async with speaking(f"http://{address}") as http:
            path = await made(http)
            answers = await sent(http, path, *LINES[:1])
            # as if hundreds had followed
            kernel._spent_s = dict.fromkeys(kernel._spent_s, 61.0)
            answers += await sent(http, path, *LINES[1:3])
            assert [answer["sequence"] for answer in answers] == [1, 2, 3]
            assert asked.wait(60.0)
            assert kernel._dispatcher is None
    finally:
        free.set()


async def test_a_client_that_comes_again_at_once_is_let_in(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was told that another client sends, for as long as its own end was being written."""
    release = StreamStore.release

    def slow(*args: Any) -> None:
        time.sleep(0.1)
        release(*args)

    monkeypatch.setattr(StreamStore, "release", slow)
    async with speaking(f"http://{address}") as http:
        path = await made(http)
        for line in LINES[:3]:
            async with websockets.connect(f"ws://{address}{path}/live") as socket_:
                await socket_.send(line.decode())
                await socket_.recv()
        assert (await sent(http, path, *LINES[3:4]))[0]["sequence"] == 4
