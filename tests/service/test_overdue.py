"""A technique that takes too long is left out beside those that have answered in time."""

import asyncio
import functools
import json
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from inference.estimate import estimate
from service.answers.encoding import AnswerShape, encode_estimates
from service.app import create_app
from service.routes import estimates
from service.service_settings import ServiceSettings
from service.shared import SMALL
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service import fake_fold
from tests.service.conftest import FRAMES, JSON, SCENE, SENSOR
from tests.service.endless import SLOW, slow_answer, slow_messages

pytestmark = pytest.mark.anyio

# what the others take is a fiftieth of it
LIMIT_S = 0.5
REASON = (
    "the request takes more than 0.5 s of processor time: "
    "ask for a posterior, state numbers as known, or send fewer frames"
)
ROS = "application/vnd.hybridtof.ros-range+json"
RANGES_M = (0.3, 0.5, 0.7, 0.9)
FIT_FRAMES = {
    "time_s": [0.0, 0.1, 0.2, 0.3],
    "w1": [0.02 * 0.3 / r for r in RANGES_M],
    "w2": [0.3 / r**2 for r in RANGES_M],
}


@pytest.fixture
async def http(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[httpx.AsyncClient]:
    """A client of a service of two processes, in which the joint fit never ends."""
    folder = str(tmp_path)
    monkeypatch.setattr(estimates, "answer_parts", functools.partial(slow_answer, folder))
    monkeypatch.setattr(estimates, "message_parts", functools.partial(slow_messages, folder))
    fake_fold.order()
    app = create_app(ServiceSettings(workers=1, threads=2, request_s=LIMIT_S), fake_fold)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://localhost", headers=JSON
        ) as client,
    ):
        yield client


def large() -> dict[str, Any]:
    """Body of a request that takes a process some milliseconds."""
    return asking("conventional", frames={"w1": [0.1] * (SMALL + 1), "w2": [0.5] * (SMALL + 1)})


def asking(*techniques: str, **changed: Any) -> dict[str, Any]:
    """Body of a request for techniques, without any for the service's choice."""
    scene = {"object": {"c0": SCENE["object"]["c0"], "c1": SCENE["object"]["c1"]}}
    body = {"sensor": SENSOR, "scene": scene, "frames": FIT_FRAMES, **changed}
    return body | ({"techniques": techniques} if techniques else {})


def assert_stopped(folder: Path, processes: int) -> None:
    """Nothing goes on: each process that the slow one was in has ended, and none was used twice."""
    ids = [int(mark.name) for mark in folder.iterdir()]
    assert len(ids) == processes
    for each in ids:
        with pytest.raises(ProcessLookupError):
            os.kill(each, 0)


def reasons(body: dict[str, Any]) -> dict[str, str]:
    return {item["technique"]: item["reason"] for item in body["left_out"]}


def assert_overdue(answer: httpx.Response) -> None:
    assert answer.status_code == 422, answer.text
    told = answer.json()
    assert (told["type"], told["detail"]) == ("urn:hybridtof:problem:overdue", REASON)


@pytest.mark.parametrize(
    ("shape", "techniques"),
    [
        ("rows", ("conventional", "differential", SLOW)),
        ("columns", (SLOW, "differential", "intensity", "conventional")),
    ],
)
async def test_others_are_answered_as_without_it(
    http: httpx.AsyncClient, tmp_path: Path, techniques: tuple[str, ...], shape: AnswerShape
) -> None:
    asked = asking(*techniques)
    got = await http.post("/v1/estimates", json=asked, params={"shape": shape})
    assert got.status_code == 200, got.text
    assert_stopped(tmp_path, 1)
    others = [name for name in techniques if name != SLOW]
    sensor, scene = parse_sensor(asked["sensor"]), parse_scene(asked["scene"])
    found = estimate(sensor, scene, frames_from_columns(sensor, asked["frames"]), others)
    body, alone = got.json(), json.loads(encode_estimates(found, shape))
    served = [result["technique"] for result in body["results"]]
    assert served == [name for name in others if name != "intensity"]
    for result in (*body["results"], *alone["results"]):
        assert result.pop("runtime_s") > 0.0
    assert reasons(body) == reasons(alone) | {SLOW: REASON}
    assert body | {"left_out": []} == alone | {"left_out": []}


@pytest.mark.parametrize("others", [(), ("iterative_differential", "intensity", "posterior")])
async def test_where_nothing_else_is_answered_it_is_the_problem_that_it_was(
    http: httpx.AsyncClient, tmp_path: Path, others: tuple[str, ...]
) -> None:
    assert_overdue(await http.post("/v1/estimates", json=asking(*others, SLOW)))
    assert_stopped(tmp_path, 1)
    after = await http.post("/v1/estimates", json=large())
    assert after.json()["chosen"] == "conventional"  # where the slow one was


async def test_what_goes_beside_the_plan_s_choice_answers_in_its_place(
    http: httpx.AsyncClient, tmp_path: Path
) -> None:
    """Nothing is named: a fit is chosen, and crosstalk that is nearly known serves another."""
    light = [{"prior": "normal", "mean": mean, "sd": 0.02 * mean} for mean in (0.002, 0.01)]
    untimed = {name: column for name, column in FIT_FRAMES.items() if name != "time_s"}
    body = asking(scene={"object": SCENE["object"], "crosstalk": light}, frames=untimed)
    got = await http.post("/v1/estimates", json=body)
    assert got.status_code == 200, got.text
    assert_stopped(tmp_path, 1)
    told = got.json()
    assert [result["technique"] for result in told["results"]] == [told["chosen"]]
    assert reasons(told)[SLOW] == REASON
    named = await http.post("/v1/estimates", json=body | {"techniques": [told["chosen"]]})
    assert named.json()["results"][0]["frames"] == told["results"][0]["frames"]


async def test_messages_are_of_what_has_answered(http: httpx.AsyncClient, tmp_path: Path) -> None:
    by = {"Accept": ROS}
    got = await http.post("/v1/estimates", json=asking(SLOW, "conventional"), headers=by)
    assert got.status_code == 200, got.text
    alone = await http.post("/v1/estimates", json=asking("conventional"), headers=by)
    assert got.json()["technique"] == "conventional"
    assert got.json() == alone.json()
    assert_overdue(await http.post("/v1/estimates", json=asking(SLOW), headers=by))
    assert_stopped(tmp_path, 2)


async def test_requests_at_the_same_time_have_each_their_own(
    http: httpx.AsyncClient, tmp_path: Path
) -> None:
    near = {name: column[:3] for name, column in FIT_FRAMES.items()}
    asked = [
        asking("conventional", SLOW),
        asking(SLOW),
        asking(SLOW, "conventional", frames=near),
        large(),
        asking("conventional", scene=SCENE, frames=FRAMES),
    ]
    posts = (http.post("/v1/estimates", json=body) for body in asked)
    first, alone, last, many, other = await asyncio.gather(*posts)
    assert_overdue(alone)
    for answer, frames in ((first, 4), (last, 3)):
        (result,) = answer.json()["results"]
        assert (result["technique"], len(result["frames"])) == ("conventional", frames)
        assert reasons(answer.json())[SLOW] == REASON
    assert len(many.json()["results"][0]["frames"]) == SMALL + 1
    assert reasons(many.json())[SLOW] != REASON
    assert len(other.json()["results"][0]["frames"]) == 2
    assert_stopped(tmp_path, 3)
