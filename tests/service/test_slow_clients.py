"""Clients that are slow, greedy, or go away: over a socket."""

import asyncio
import contextlib
import json
import logging
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks.fleet import Service
from benchmarks.manners import ask, crowd, heaviest, memory_mb, probes
from service.app import create_app
from service.border.held import Held, Room
from service.errors import BusyError
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.conftest import FRAMES, SCENE, SENSOR, listening, speaking
from tests.service.test_server import fake_server

pytestmark = pytest.mark.anyio

LIMITS: dict[str, Any] = {
    "workers": 1,
    "client_s": 0.5,
    "connections": 4,
    "max_body_bytes": 2000,
    "max_held_bytes": 2500,
}


WAIT_S = 300.0  # for what comes in a second


@pytest.fixture
async def address() -> AsyncIterator[str]:
    fake_fold.order()
    async with listening(create_app(ServiceSettings(**LIMITS), fake_fold)) as found:
        yield found


class Connection:
    """What a client says, as it stands here, and what it is told."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    @classmethod
    async def to(cls, address: str, *lines: str, body: bytes = b"") -> "Connection":
        host, _, port = address.rpartition(":")
        opened = cls(*await asyncio.open_connection(host, int(port)))
        opened.writer.write("\r\n".join(lines).encode() + body)
        return opened

    @classmethod
    async def posting(cls, address: str, declared: int, body: bytes) -> "Connection":
        head = ("POST /v1/estimates HTTP/1.1", f"Host: {address}", "Content-Type: application/json",
                f"Content-Length: {declared}", "", "")  # fmt: skip
        return await cls.to(address, *head, body=body)

    async def told(self) -> bytes:
        """All that comes until the service closes the connection."""
        try:
            return await self.reader.read()
        except ConnectionError:
            return b""
        finally:
            await self.close()

    async def first_line(self) -> bytes:
        """The first line of an answer; then hang up."""
        try:
            return await self.reader.readline()
        finally:
            await self.close()

    async def close(self) -> None:
        self.writer.transport.abort()
        with contextlib.suppress(ConnectionError):
            await self.writer.wait_closed()


async def served(address: str) -> bool:
    async with speaking(f"http://{address}") as http:
        return (await http.get("/health/live")).status_code == 200


async def test_a_head_that_does_not_end(address: str) -> None:
    begun = await Connection.to(address, "GET /health/live HTTP/1.1", "Ho")
    silent = await Connection.to(address)
    for _ in range(3):  # a byte now and then does not help
        begun.writer.write(b"s")
        await asyncio.sleep(0)
    answer = await begun.told()
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"application/problem+json" in answer
    assert await silent.told() == b""
    assert await served(address)


async def test_what_is_no_request(address: str) -> None:
    answer = await (await Connection.to(address, "nonsense", "", "")).told()
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 ")
    assert json.loads(body)["type"].endswith("malformed")


async def test_a_body_that_does_not_come(address: str) -> None:
    half = await Connection.posting(address, 1000, b"{")
    answer = await half.told()  # a body that nobody reads any more has a deadline of its own
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert json.loads(answer.partition(b"\r\n\r\n")[2])["status"] == 408
    assert await served(address)


async def test_bodies_have_room_together(address: str) -> None:
    while True:  # until those bytes are held, which they are for a moment
        first = await Connection.posting(address, 1900, b" " * 1800)
        second = await Connection.posting(address, 1900, b" " * 1900)
        line = await second.first_line()
        await first.close()
        if b" 503 " in line:
            break
        assert b" 400 " in line  # blanks are no JSON
    body = json.dumps({"sensor": SENSOR, "scene": SCENE, "frames": FRAMES}).encode()
    while True:  # until they are let go
        answer = await (await Connection.posting(address, len(body), body)).first_line()
        if b" 200 " in answer:
            break
        assert b" 503 " in answer


async def test_connections_have_an_end(address: str) -> None:
    first = [await Connection.to(address, "GET /") for _ in range(4)]
    fifth = await Connection.to(address)
    assert await fifth.told() == b""
    for connection in first:  # these have their deadline, and then others have room
        assert b" 408 " in await connection.told()
    assert await served(address)


async def test_a_client_that_does_not_read(caplog: pytest.LogCaptureFixture) -> None:
    app = create_app(ServiceSettings(**LIMITS | {"max_held_bytes": 10**8}), fake_fold)
    trajectory = {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": 100_000}
    body = json.dumps({"sensor": SENSOR, "scene": SCENE, "trajectory": trajectory}).encode()
    async with listening(app) as address:
        host, _, port = address.rpartition(":")
        with socket.socket() as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.connect((host, int(port)))
            head = ("POST /v1/simulations HTTP/1.1", f"Host: {address}",
                    "Content-Type: application/json", f"Content-Length: {len(body)}")  # fmt: skip
            deaf.sendall("\r\n".join([*head, "", ""]).encode() + body)
            async with asyncio.timeout(WAIT_S):
                while "its client does not read" not in caplog.text:
                    await asyncio.sleep(0.02)
        assert await served(address)


async def test_a_hang_up_is_one_line(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    # that of a body that does not come is another line, and may be sooner on a busy machine
    app = create_app(ServiceSettings(**LIMITS | {"client_s": 600.0}), fake_fold)
    async with listening(app) as address, speaking(f"http://{address}") as http:
        half = await Connection.posting(address, 1000, b"{")
        while "hybridtof_requests_open 2.0" not in (await http.get("/metrics")).text:
            await asyncio.sleep(0)
        caplog.clear()
        await half.close()
        while "hybridtof_requests_open 2.0" in (await http.get("/metrics")).text:
            await asyncio.sleep(0)
        told = [record for record in caplog.records if "/metrics" not in record.getMessage()]
    told = [record for record in told if record.name.startswith(("hybridtof", "uvicorn"))]
    assert len(told) == 1, told
    assert told[0].exc_info is None
    assert "/v1/estimates" in told[0].getMessage()


def test_a_small_body_has_room_where_large_ones_have_none() -> None:
    room = Room(512 * 100)
    large, small = Held(room), Held(room)
    large.take(512 * 100)
    for _ in range(2):
        small.take(50)
    with pytest.raises(BusyError):
        small.take(1)
    small.release()
    large.release()
    assert room.used == 0


async def test_a_crowd_costs_the_others_nothing(tmp_path: Path) -> None:
    """The long version, with what is waited for, is `python -m benchmarks.manners`."""
    settings = {
        "HYBRIDTOF_DATABASE": f"sqlite:///{tmp_path}/jobs.sqlite",
        "KERNELS_COMPILE": "always",  # what a compiler takes is not the crowd's
    }
    service = Service(fake_server(2**25), settings)
    address = service.address.removeprefix("http://")
    try:
        for path, body, status in probes().values():  # what is imported by the first
            assert (await ask(address, path, body))[0] == status
        before = memory_mb(service.process.pid)
        async with crowd(address, slow=40, half=4, deaf=2):
            for _ in range(5):
                for path, body, status in probes().values():
                    assert (await ask(address, path, body))[0] == status
                assert memory_mb(service.process.pid) < before + 64
    finally:
        service.kill()


async def test_heavy_requests_hold_up_nobody(tmp_path: Path) -> None:
    """Others are answered before two fits that would take minutes."""
    settings = {"HYBRIDTOF_DATABASE": f"sqlite:///{tmp_path}/jobs.sqlite"}
    service = Service(fake_server(2**25), settings)
    address = service.address.removeprefix("http://")
    path, body = heaviest()["fit of 10,000 frames, all unknown"]
    try:
        fits = [asyncio.ensure_future(ask(address, path, body)) for _ in range(2)]
        await asyncio.sleep(0)
        for _ in range(2):
            for other, small, status in probes().values():
                assert (await ask(address, other, small))[0] == status
        assert not any(fit.done() for fit in fits)
        for fit in fits:
            fit.cancel()
        await asyncio.gather(*fits, return_exceptions=True)
    finally:
        service.kill()
