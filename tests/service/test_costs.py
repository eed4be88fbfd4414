"""No request costs more than it may: deadlines, queues with an end, caps, work given up."""

import asyncio
import math
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import Request

from service.app import create_app
from service.errors import BusyError, ClientGoneError, OverdueError
from service.lanes import Processes, Threads
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.conftest import JSON

pytestmark = pytest.mark.anyio


class Asking:
    """A request whose client stays until it goes."""

    def __init__(self) -> None:
        self.gone = asyncio.Event()

    async def receive(self) -> dict[str, Any]:
        await self.gone.wait()
        return {"type": "http.disconnect"}

    @property
    def request(self) -> Request:
        return Request({"type": "http"}, self.receive)


def burn(begun: str) -> None:
    """Never end."""
    Path(begun).touch()
    while True:
        pass


def wait_for(begun: str, mark: str) -> str:
    """Wait for a mark, for as long as anybody wants."""
    Path(begun).touch()
    while not Path(mark).exists():
        math.sqrt(2.0)
    return "waited"


async def until(path: Path) -> None:
    while not path.exists():
        await asyncio.sleep(0.01)


@pytest.fixture
async def processes() -> AsyncIterator[Processes]:
    lane = Processes(1, 1, 0.2)
    assert await lane.run(Asking().request, math.sqrt, 4.0) == 2.0  # its process has begun
    yield lane
    await asyncio.to_thread(lane.close)


async def test_too_long_is_ended_once(processes: Processes, tmp_path: Path) -> None:
    with pytest.raises(OverdueError, match=r"more than 0 s of processor time"):
        await processes.run(Asking().request, burn, str(tmp_path / "begun"))
    assert await processes.run(Asking().request, math.sqrt, 9.0) == 3.0


async def test_who_hangs_up_gives_up(tmp_path: Path) -> None:
    lane = Processes(1, 1, 1e6)
    begun, mark = tmp_path / "begun", tmp_path / "mark"
    first, second = Asking(), Asking()
    try:
        works = asyncio.create_task(lane.run(first.request, wait_for, str(begun), str(mark)))
        waits = asyncio.create_task(lane.run(second.request, math.sqrt, 4.0))
        await until(begun)
        third = asyncio.create_task(lane.run(Asking().request, math.sqrt, 4.0))
        await asyncio.sleep(0)  # a refusal waits for nothing; what is not refused ends all the same
        first.gone.set()
        with pytest.raises(BusyError):
            await third
        with pytest.raises(ClientGoneError):
            await works
        assert await waits == 2.0  # although the mark never came
    finally:
        await asyncio.to_thread(lane.close)


async def test_a_queue_for_threads_has_an_end(tmp_path: Path) -> None:
    lane = Threads(1, 1)
    begun, mark = tmp_path / "begun", tmp_path / "mark"
    asking = Asking()
    works = asyncio.create_task(lane.run(Asking().request, wait_for, str(begun), str(mark)))
    await until(begun)
    waits = asyncio.create_task(lane.run(asking.request, math.sqrt, 4.0))
    while not (waits.done() or lane._limiter.statistics().tasks_waiting):
        await asyncio.sleep(0)
    another = asyncio.create_task(lane.run(Asking().request, math.sqrt, 4.0))
    await asyncio.sleep(0)  # a refusal waits for nothing; what is not refused ends with the mark
    asking.gone.set()
    with pytest.raises(ClientGoneError):
        await waits
    mark.touch()
    assert await works == "waited"
    with pytest.raises(BusyError):
        await another


async def test_caps(request_body: dict[str, Any]) -> None:
    fake_fold.order()
    caps = {"max_seconds": 5, "max_target_ess": 300, "max_ensembles": 3, "max_trajectory": 4}
    settings = ServiceSettings.model_validate({"workers": 1, "max_fit_frames": 1, **caps})
    app = create_app(settings, fake_fold)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://localhost", headers=JSON
        ) as http,
    ):
        body = request_body | {"sampler": {"max_seconds": 6.0, "target_ess": 301, "ensembles": 4}}
        refused = await http.post("/v1/posteriors", json=body)
        pointers = {error["pointer"] for error in refused.json()["errors"]}
        assert refused.status_code == 422
        assert pointers == {"/sampler/max_seconds", "/sampler/target_ess", "/sampler/ensembles"}
        # what is left out is lowered
        assert (await http.post("/v1/posteriors", json=request_body)).status_code == 202
        fit = await http.post("/v1/estimates", json=request_body | {"techniques": ["joint_fit"]})
        assert (fit.status_code, fit.json()["errors"][0]["pointer"]) == (422, "/frames")
        assert "ask for a posterior" in fit.json()["detail"]
        del request_body["frames"]
        for way, member in (
            ({"kind": "radial", "from_m": 0.2, "to_m": 1.0, "frames": 5}, "frames"),
            ({"range_m": [0.5] * 5}, "range_m"),
        ):
            asked = request_body | {"trajectory": way}
            refused = await http.post("/v1/simulations", json=asked)
            assert refused.json()["errors"][0]["pointer"] == f"/trajectory/{member}"


async def test_a_fit_is_the_same_in_another_process(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    """Fits over many frames leave the threads to others."""
    del request_body["scene"]["object"]["c2"]
    ranges = [0.3, 0.5, 0.7, 0.9]
    request_body["frames"] = {
        "w1": [0.02 * 0.3 / r for r in ranges],
        "w2": [0.3 / r**2 for r in ranges],
    }
    answer = await client.post("/v1/estimates", json=request_body | {"techniques": ["joint_fit"]})
    assert answer.status_code == 200, answer.text
