"""A client of the application without a network, and the simplest requests."""

import copy
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest

from service.app import create_app
from service.service_settings import ServiceSettings
from tests.service import fake_fold

SENSOR: dict[str, Any] = {
    "kind": "pulsed",
    "pulse_width_s": 1e-7,
    "gain": 1.0,
    "noise": {"read": [1e-6, 1e-6]},
}
SCENE: dict[str, Any] = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}}
FRAMES: dict[str, Any] = {"time_s": [0.0, 0.1], "w1": [0.01, 0.02], "w2": [1.5, 1.7]}


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


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
        httpx.AsyncClient(transport=transport, base_url="http://test") as http,
    ):
        yield http
