"""Streams that calibrate themselves over HTTP, with real posteriors in the pool."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import httpx
import pytest

from inference.self_calibration.calibration import Asked
from inference.self_calibration.plan import plan_of
from inference.tracking.settings import TrackingSettings
from service.app import create_app
from service.service_settings import ServiceSettings
from service.streams.calibrated_here import concluding_as_before
from service.streams.calibrations import Calibrations, posterior_id
from service.streams.followers import Calibrating
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Line, Place
from service.streams.model import model_of
from service.streams.taking import take
from tests.self_calibration.test_following import DRIFTING, SENSOR, STATED, course

pytestmark = pytest.mark.anyio

NDJSON = {"Content-Type": "application/x-ndjson"}
SYSTEM = {
    "sensor": SENSOR.model_dump(mode="json", exclude_none=True),
    "scene": STATED.model_dump(mode="json", exclude_none=True),
    "tracking": {"rate_sd": 0.5},
    "calibrate": True,
}


def lines() -> list[bytes]:
    columns = course().to_columns(SENSOR)
    rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    return [json.dumps(row).encode() for row in rows]


@contextlib.asynccontextmanager
async def served(tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    app = create_app(
        ServiceSettings(workers=1, warm=False, database=f"sqlite:///{tmp_path}/s.sqlite")
    )
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost") as http,
    ):
        yield http


async def made(http: httpx.AsyncClient, **more: Any) -> str:
    response = await http.post("/v1/streams", json=SYSTEM | more)
    assert response.status_code == 201, response.text
    assert response.json()["status"] == "calibrating"
    return str(response.headers["Location"])


async def sent(http: httpx.AsyncClient, path: str, some: list[bytes]) -> list[dict[str, Any]]:
    response = await http.post(path + "/frames", content=b"\n".join(some), headers=NDJSON)
    return [json.loads(line) | {"latency_s": None} for line in response.text.splitlines()]


async def until_told(http: httpx.AsyncClient, path: str, rest: list[bytes]) -> list[dict[str, Any]]:
    """Send lines one by one, when the posterior has ended, until one tells what became of it."""
    posterior = (await http.get(path)).json()["calibration"]["asked"]["posterior"]
    while (status := (await http.get(f"/v1/posteriors/{posterior}")).json()["status"]) not in {
        "done",
        "cancelled",
    }:
        assert status != "failed"  # it may not be there yet
        await asyncio.sleep(0.1)
    found: list[dict[str, Any]] = []
    while not found or "calibration" not in found[-1]:
        # the scene is made from the posterior's draws in the pool
        await asyncio.sleep(0.05)
        found += await sent(http, path, [rest.pop(0)])
    return found


class _Unending:
    """Jobs of which none ends."""

    def __init__(self) -> None:
        self.asked, self.cancelled = asyncio.Event(), asyncio.Event()

    async def follow(self, posterior: str, client: str) -> AsyncIterator[Any]:
        assert (posterior, client) == (posterior_id("stream", 1), "me")
        self.asked.set()
        await asyncio.Event().wait()
        yield

    async def cancel(self, posterior: str, client: str) -> None:
        assert (posterior, client) == (posterior_id("stream", 1), "me")
        self.cancelled.set()


@pytest.mark.parametrize("ends", ["service", "stream"])
async def test_a_service_that_ends_cancels_no_posterior(ends: str) -> None:
    """The next one goes on with it; what a stream no longer wants is cancelled."""
    jobs = _Unending()
    calibrations = Calibrations(cast(Any, jobs), ServiceSettings(workers=1, warm=False))
    asked = Asked(1, 2, "", 30, (1,), STATED, course().select(slice(0, 1)))
    plan = plan_of(SENSOR, STATED, TrackingSettings(), 7)
    assert calibrations.outcome("stream", "me", plan, asked) is None
    await jobs.asked.wait()
    if ends == "stream":
        calibrations.forget("stream")
        await jobs.cancelled.wait()
    await calibrations.close()
    assert jobs.cancelled.is_set() == (ends == "stream")


@pytest.mark.slow
async def test_a_stream_learns_its_scene_through_a_restart(tmp_path: Path) -> None:
    rest = lines()
    first, rest = rest[:60], rest[60:]
    async with served(tmp_path) as http:
        path = await made(http)
        answers = await sent(http, path, first)
        stands = (await http.get(path)).json()
        assert stands["status"] == "calibrating"
        asked = stands["calibration"]["asked"]
        assert asked["number"] == 1
    async with served(tmp_path) as http:
        # the row knows what was asked for, and nobody asks twice
        assert (await http.get(path)).json() == stands
        answers += await sent(http, path, [rest.pop(0)])
        answers += await until_told(http, path, rest)
        listed = (await http.get("/v1/posteriors")).json()["items"]
        assert [item["id"] for item in listed] == [asked["posterior"]]
        answers += await sent(http, path, rest)
        stands = (await http.get(path)).json()
        page = (await http.get("/v1/streams")).json()["items"]
    assert page == [stands]
    assert stands["status"] == "tracking"
    told = [answer["calibration"] for answer in answers if "calibration" in answer]
    assert [event["kind"] for event in told] == ["taken"]
    assert [event | {"posterior": asked["posterior"]} for event in told] == stands["calibration"][
        "events"
    ]
    assert [answer["sequence"] for answer in answers] == list(range(1, 601))
    # the same frames, the same seed, the same numbers: the same answers to the last bit
    plan = plan_of(SENSOR, STATED, DRIFTING.settings, stands["calibration"]["seed"])
    before = concluding_as_before(plan, {event["number"]: event for event in told})
    follower = Calibrating.of(plan, before)
    taken = take(
        follower, Place(follower.first), [Line(raw, 0.0) for raw in lines()], JsonLines(), Kept()
    )
    assert [json.loads(line) | {"latency_s": None} for line in taken.answers] == answers


async def test_a_posterior_that_is_cancelled_is_not_taken(tmp_path: Path) -> None:
    rest = lines()
    async with served(tmp_path) as http:
        path = await made(http, seed=5)
        await sent(http, path, rest[:30])
        rest = rest[30:]
        stands = (await http.get(path)).json()["calibration"]
        assert stands["seed"] == 5
        posterior = stands["asked"]["posterior"]
        while (await http.post(f"/v1/posteriors/{posterior}/cancel")).status_code == 404:
            await asyncio.sleep(0.01)  # it is being asked for
        told = await until_told(http, path, rest)
        event = told[-1]["calibration"]
        assert (event["kind"], event["reason"]) == ("not_taken", "the posterior was cancelled")
        stands = (await http.get(path)).json()
        assert (stands["status"], stands["calibration"]["asked"]) == ("calibrating", None)
        assert (await http.delete(path)).status_code == 204


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"scene": {"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}}}, "/calibrate"),
        ({"calibrate": False, "seed": 3}, "/seed"),
        ({"calibrate": "yes"}, "/calibrate"),
        ({"seed": -1}, "/seed"),
    ],
)
async def test_what_cannot_be_calibrated_is_refused(
    tmp_path: Path, change: dict[str, Any], pointer: str
) -> None:
    async with served(tmp_path) as http:
        response = await http.post("/v1/streams", json=SYSTEM | change)
        assert response.status_code == 422
        assert [error["pointer"] for error in response.json()["errors"]] == [pointer]


async def test_a_line_without_the_temperature_that_a_gain_follows_is_an_error() -> None:
    """Of that line alone."""
    plain = SENSOR.model_dump(mode="json", exclude_none=True)
    warm = plain | {"temperature": {"gain_drift_per_k": -0.003}}
    follower = model_of(json.dumps(SYSTEM | {"sensor": warm, "seed": 7}).encode())
    kelvin = [300.0, None, 301.0, 302.0, 303.0]
    told = [
        json.dumps(json.loads(line) | {"temperature_k": value}).encode()
        for line, value in zip(lines(), kelvin, strict=False)
    ]
    given = [Line(raw, 0.0) for raw in told]
    taken = take(follower, Place(follower.first), given, JsonLines(), Kept())
    answers = [json.loads(line) for line in taken.answers]
    pointers = [answer.get("error", {}).get("pointer") for answer in answers]
    assert pointers == [None, "/temperature_k", None, None, None]
    assert not any("assumptions" in answer for answer in answers)
    again = take(follower, Place(follower.first), [given[0], *given[2:]], JsonLines(), Kept())
    ranges = [json.loads(line)["range_m"] for line in again.answers]
    assert ranges == [answer["range_m"] for answer in answers if "error" not in answer]
