"""A client of the application without a network, and the simplest requests."""

import asyncio
import contextlib
import copy
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from service.app import create_app
from service.server import server_of
from service.service_settings import ServiceSettings
from tests.service import fake_fold

SENSOR: dict[str, Any] = {
    "kind": "pulsed",
    "pulse_width_s": 1e-7,
    "gain": 1.0,
    "noise": {"read": [1e-6, 1e-6]},
}
SCENE: dict[str, Any] = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}}
JSON = {"Content-Type": "application/json"}
FRAMES: dict[str, Any] = {"time_s": [0.0, 0.1], "w1": [0.01, 0.02], "w2": [1.5, 1.7]}


@pytest.fixture
def request_body() -> dict[str, Any]:
    return copy.deepcopy({"sensor": SENSOR, "scene": SCENE, "frames": FRAMES})


@pytest.fixture
async def client() -> AsyncIterator[httpx.AsyncClient]:
    """Client of an application whose posteriors are `fake_fold`; its jobs run."""
    fake_fold.order()
    app = create_app(ServiceSettings(workers=2, threads=2), fake_fold)
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=JSON) as http,
    ):
        yield http


@contextlib.asynccontextmanager
async def listening(app: FastAPI) -> AsyncIterator[str]:
    """The application behind a real socket, in this process; its address."""
    server = server_of(app, app.state.shared.settings, port=0, log_config=None)
    serving = asyncio.create_task(server.serve())
    try:
        while not server.started:
            await asyncio.sleep(0.005)
            assert not serving.done()
        port = server.servers[0].sockets[0].getsockname()[1]
        yield f"127.0.0.1:{port}"
    finally:
        server.should_exit = True
        await serving


async def told(address: str, *lines: str, body: bytes = b"") -> tuple[int, dict[str, str], bytes]:
    """Send a request as it stands here, over a connection of its own: status, headers, body."""
    host, _, port = address.rpartition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write("\r\n".join([*lines, "Connection: close", "", ""]).encode("latin-1") + body)
    answer = await reader.read()
    writer.close()
    await writer.wait_closed()
    head, _, content = answer.partition(b"\r\n\r\n")
    first, *rest = head.decode("latin-1").split("\r\n")
    pairs = (line.split(": ", 1) for line in rest)
    return int(first.split()[1]), {name.lower(): value for name, value in pairs}, content


def speaking(address: str, headers: dict[str, str] | None = None) -> httpx.AsyncClient:
    """A client that waits for as long as the server lives."""
    return httpx.AsyncClient(
        base_url=address,
        headers=headers,
        timeout=None,  # noqa: S113  (a clock knows no load)
    )
