"""Posteriors over ASGI, without a network: asked for, watched, cancelled, forgotten."""

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.answers.posteriors import PosteriorPage, PosteriorResponse
from service.app import create_app
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.problem_answers import assert_problem

pytestmark = pytest.mark.anyio


async def ended(client: httpx.AsyncClient, location: str) -> dict[str, Any]:
    while True:
        body: dict[str, Any] = (await client.get(location)).json()
        if body["status"] not in {"queued", "running"}:
            return body
        await asyncio.sleep(0.01)


async def test_posterior(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    request_body["sampler"] = {"seed": 3}
    response = await client.post("/v1/posteriors", json=request_body)
    assert response.status_code == 202, response.text
    location = response.headers["location"]
    first = response.json()
    assert location == f"/v1/posteriors/{first['id']}"
    assert first["status"] in {"queued", "running"}
    assert (first["seed"], first["verdict"]) == (3, None)
    body = await ended(client, location)
    assert body["status"] == "done"
    assert body.keys() == first.keys()
    assert body["verdict"] == {"converged": True, "reasons": []}
    assert PosteriorResponse.model_validate(body).model_dump(exclude={"problem"}) == body
    assert (await client.delete(location)).status_code == 204
    assert_problem(await client.get(location), 404)
    assert_problem(await client.delete(location), 404)
    assert_problem(await client.post(location + "/cancel"), 404)


async def test_posterior_refused(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    request_body["scene"]["discrepancy"] = 0.1
    response = await client.post("/v1/posteriors", json=request_body)
    assert_problem(response, 422)
    assert response.json()["type"].endswith("refused")


@pytest.mark.parametrize(
    ("name", "value"),
    [("method", "nuts"), ("ensembles", 0), ("ensembles", 4.5), ("max_seconds", -1), ("x", 1)],
)
async def test_sampler_settings(
    client: httpx.AsyncClient, request_body: dict[str, Any], name: str, value: Any
) -> None:
    request_body["sampler"] = {name: value}
    response = await client.post("/v1/posteriors", json=request_body)
    assert_problem(response, 422, f"/sampler/{name}")


async def test_cancel(
    client: httpx.AsyncClient, request_body: dict[str, Any], tmp_path: Path
) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    location = (await client.post("/v1/posteriors", json=request_body)).headers["location"]
    response = await client.post(location + "/cancel")
    assert response.status_code == 202
    (tmp_path / "mark").touch()
    assert (await ended(client, location))["status"] == "cancelled"


def read_events(text: str) -> list[tuple[int, Any]]:
    """Ids and data of server-sent events."""
    found = re.findall(r"^data: (.*)\nid: (\d+)$", text, re.MULTILINE)
    return [(int(number), json.loads(data)) for data, number in found]


async def test_events(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    location = (await client.post("/v1/posteriors", json=request_body)).headers["location"]
    response = await client.get(location + "/events")  # it ends with the posterior
    assert response.headers["content-type"].startswith("text/event-stream")
    told = read_events(response.text)
    assert told
    numbers = [number for number, _ in told]
    assert numbers == sorted(set(numbers))
    last = (await client.get(location)).json()
    assert told[-1][1] == {name: last[name] for name in told[-1][1]}
    assert (last["status"], last["progress"]["phase"]) == ("done", "summarising")
    for _, data in told[:-1]:
        assert data["progress"]["eta_s"] != 0.0  # it had not ended
    # behind the last but one there is one more; behind the last, nothing to wait for
    seen = {"Last-Event-ID": str(numbers[-1] - 1)}
    again = await client.get(location + "/events", headers=seen)
    assert read_events(again.text) == told[-1:]
    seen = {"Last-Event-ID": str(numbers[-1])}
    ended = await client.get(location + "/events", headers=seen)
    assert (ended.status_code, ended.content) == (204, b"")
    assert_problem(await client.get("/v1/posteriors/none/events"), 404)


async def test_draws(
    client: httpx.AsyncClient, request_body: dict[str, Any], tmp_path: Path
) -> None:
    fake_fold.order(hold=str(tmp_path / "mark"))
    location = (await client.post("/v1/posteriors", json=request_body)).headers["location"]
    assert_problem(await client.get(location + "/draws"), 409)
    (tmp_path / "mark").touch()
    assert (await ended(client, location))["status"] == "done"
    netcdf = await client.get(location + "/draws")
    assert netcdf.status_code == 200
    assert netcdf.headers["content-type"] == "application/x-netcdf"
    assert netcdf.headers["vary"] == "Accept"
    assert netcdf.headers["content-disposition"].endswith('.nc"')
    assert netcdf.content.startswith(b"\x89HDF")
    ndjson = await client.get(location + "/draws", headers={"Accept": "application/x-ndjson"})
    assert ndjson.headers["content-type"] == "application/x-ndjson"
    drawn = [json.loads(line) for line in ndjson.text.splitlines()]
    assert {"ensemble", "walker", "step", "parameters"} <= drawn[0].keys()
    refused = await client.get(location + "/draws", headers={"Accept": "application/json"})
    assert_problem(refused, 406)
    assert_problem(await client.get("/v1/posteriors/none/draws"), 404)


async def test_draws_that_were_dropped(request_body: dict[str, Any]) -> None:
    fake_fold.order()
    app = create_app(ServiceSettings(workers=1, max_draws_bytes=1), fake_fold)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as http,
    ):
        location = (await http.post("/v1/posteriors", json=request_body)).headers["location"]
        assert (await ended(http, location))["status"] == "done"
        response = await http.get(location + "/draws")
    assert_problem(response, 410)
    assert "seed" in response.json()["detail"]


async def test_idempotency_key(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    key = {"Idempotency-Key": "one"}
    first = await client.post("/v1/posteriors", json=request_body, headers=key)
    again = await client.post("/v1/posteriors", json=request_body, headers=key)
    assert first.headers["location"] == again.headers["location"]
    request_body["sampler"] = {"seed": 9}
    other = await client.post("/v1/posteriors", json=request_body, headers=key)
    assert_problem(other, 422)
    for bad in ("", "a b", "x" * 256):
        response = await client.post(
            "/v1/posteriors", json=request_body, headers={"Idempotency-Key": bad}
        )
        assert_problem(response, 400)


async def test_pages(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    made = [(await client.post("/v1/posteriors", json=request_body)).json()["id"] for _ in range(5)]
    found: list[str] = []
    parameters: dict[str, Any] = {"limit": 2}
    while True:
        page = (await client.get("/v1/posteriors", params=parameters)).json()
        assert PosteriorPage.model_validate(page).model_dump() == page
        found += [item["id"] for item in page["items"]]
        if page["next_cursor"] is None:
            break
        parameters["cursor"] = page["next_cursor"]
    assert found == made[::-1]
    assert_problem(await client.get("/v1/posteriors?cursor=x"), 400)
    assert_problem(await client.get("/v1/posteriors?limit=0"), 422, "/query/limit")
