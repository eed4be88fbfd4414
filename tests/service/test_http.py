"""Routes over ASGI, without a network."""

import json
from typing import Any

import httpx
import pytest

from inference.run import NOT_SMALL
from service.answers.estimates import EstimatesResponse
from service.answers.simulations import SimulationResponse
from service.app import create_app
from service.messages import MESSAGES
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.problem_answers import assert_problem

pytestmark = pytest.mark.anyio


async def test_estimates(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    response = await client.post("/v1/estimates", json=request_body)
    assert response.status_code == 200, response.text
    body = response.json()
    assert body["chosen"] == body["results"][0]["technique"]
    (result,) = body["results"]
    assert result["runtime_s"] > 0
    assert result["parameters"] is None
    for frame in result["frames"]:
        assert frame["status"] in {"unique", "ambiguous", "none", "saturated"}
    assert {item["technique"] for item in body["left_out"]} >= {"posterior", "object_fit"}
    assert all(item["reason"] for item in body["left_out"])
    EstimatesResponse.model_validate(body)


async def test_estimates_as_columns(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    rows = (await client.post("/v1/estimates", json=request_body)).json()
    answer = await client.post("/v1/estimates?shape=columns", json=request_body)
    columns = answer.json()["results"][0]["frames"]
    for name, column in columns.items():
        if name != "sd_parts_m":
            assert column == [frame.get(name) for frame in rows["results"][0]["frames"]]
    refused = await client.post("/v1/estimates?shape=heap", json=request_body)
    assert refused.status_code == 422
    assert [error["pointer"] for error in refused.json()["errors"]] == ["/query/shape"]


async def test_estimates_as_messages(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    plain = (await client.post("/v1/estimates", json=request_body)).json()
    for message in MESSAGES:
        headers = {"Accept": f"application/json;q=0.5, {message.media_type}"}
        response = await client.post("/v1/estimates", json=request_body, headers=headers)
        assert response.status_code == 200, response.text
        assert response.headers["content-type"] == message.media_type
        assert response.headers["vary"] == "Accept"
        body = response.json()
        assert body["technique"] == plain["chosen"]
        assert len(body["messages"]) == len(plain["results"][0]["frames"])
    unknown = {"Accept": "text/csv, application/xml;q=0.5"}
    refused = await client.post("/v1/estimates", json=request_body, headers=unknown)
    assert_problem(refused, 406)
    assert "application/json" in refused.json()["detail"]
    for anything in ("application/*", "text/csv, */*;q=0.1"):
        taken = await client.post("/v1/estimates", json=request_body, headers={"Accept": anything})
        assert taken.headers["content-type"] == "application/json"
    request_body["scene"] = {
        "crosstalk": [{"prior": "halfnormal", "sd": 1.0}] * 2,
        "motion": "static",
    }
    refused = await client.post("/v1/estimates", json=request_body, headers=headers)
    assert_problem(refused, 422)
    assert "no technique serves this scene" in refused.json()["detail"]
    request_body["techniques"] = ["conventional"]
    refused = await client.post("/v1/estimates", json=request_body, headers=headers)
    assert_problem(refused, 422)
    # of what was not asked for it says nothing
    assert f"scene: conventional: {NOT_SMALL}" in refused.json()["detail"]


async def test_conventional_range(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    request_body["techniques"] = ["conventional"]
    response = await client.post("/v1/estimates", json=request_body)
    frame = response.json()["results"][0]["frames"][1]
    r0 = 299_792_458 * 1e-7 / 2
    assert frame["status"] == "unique"
    assert frame["range_m"] == pytest.approx(0.02 / 1.7 * r0, rel=1e-14)
    assert frame["roots_m"] == [frame["range_m"]]


async def test_saturated_frame_alone(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    request_body["sensor"]["full_scale"] = [1.6, 1.6]
    request_body["techniques"] = ["conventional"]
    response = await client.post("/v1/estimates", json=request_body)
    frames = response.json()["results"][0]["frames"]
    assert [f["status"] for f in frames] == ["unique", "saturated"]


@pytest.mark.parametrize(("w1", "w2"), [(0.1, -1.0), (0.1, 0.0), (2.0, 1.0), (-0.1, 1.0)])
async def test_unphysical_frame_has_a_status(
    client: httpx.AsyncClient, request_body: dict[str, Any], w1: float, w2: float
) -> None:
    request_body["frames"] = {"w1": [0.02, w1], "w2": [1.7, w2]}
    request_body["techniques"] = ["conventional"]
    response = await client.post("/v1/estimates", json=request_body)
    good, bad = response.json()["results"][0]["frames"]
    assert good["status"] == "unique"
    assert bad["status"] == "none"
    assert bad["reason"]
    assert bad["roots_m"] == []


async def test_the_root_says_where_to_go(client: httpx.AsyncClient) -> None:
    answer = await client.get("/")
    assert answer.status_code == 200
    told = answer.json()
    described = (await client.get(told["openapi"])).json()
    assert (told["name"], told["version"]) == ("hybridtof", described["info"]["version"])
    assert (await client.get(told["health"])).status_code == 200
    assert {"/v1/estimates", "/v1/posteriors", "/v1/streams"} <= set(told["resources"])
    assert set(told["resources"]) < described["paths"].keys()


async def test_techniques(client: httpx.AsyncClient) -> None:
    body = (await client.get("/v1/techniques")).json()
    found = {item["name"]: item for item in body["techniques"]}
    assert {"conventional", "intensity", "background_cancelling"} <= found.keys()
    for item in found.values():
        assert item["cost"] > 0
        assert item["kinds"]
        assert item["equations"]


async def test_health(client: httpx.AsyncClient) -> None:
    assert (await client.get("/health/live")).status_code == 200
    assert (await client.get("/health/ready")).status_code == 200


async def test_not_ready_before_the_start() -> None:
    transport = httpx.ASGITransport(create_app(ServiceSettings(workers=1), fake_fold))
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as http:
        assert (await http.get("/health/live")).status_code == 200
        response = await http.get("/health/ready")
        assert_problem(response, 503)
        assert response.headers["retry-after"]


@pytest.mark.parametrize(
    "trajectory",
    [
        {"range_m": [0.5, 1.0], "time_s": [0.0, 0.1]},
        {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": 2, "spacing": "log"},
    ],
)
async def test_simulation_and_back(
    client: httpx.AsyncClient, request_body: dict[str, Any], trajectory: dict[str, Any]
) -> None:
    del request_body["frames"]
    request_body["scene"]["object"]["c2"] = {"prior": "lognormal", "median": 0.1, "sigma": 1.0}
    content = request_body | {"trajectory": trajectory, "seed": 4}
    response = await client.post("/v1/simulations", json=content)
    assert response.status_code == 200, response.text
    body = response.json()
    assert body.keys() == {"frames", "truth", "seed"}
    SimulationResponse.model_validate(body)
    assert body["truth"]["parameters"].keys() == {"object.c2"}
    assert len(body["truth"]["range_m"]) == 2
    assert (await client.post("/v1/simulations", json=content)).json() == body
    back = request_body | {"frames": body["frames"], "techniques": ["conventional"]}
    (result,) = (await client.post("/v1/estimates", json=back)).json()["results"]
    for frame, truth in zip(result["frames"], body["truth"]["range_m"], strict=True):
        # six standard deviations: a false alarm once in 5e8 frames, and the seed is fixed
        assert abs(frame["range_m"] - truth) < 6 * frame["sd_m"]


async def test_simulation_draws_a_seed(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    del request_body["frames"]
    request_body["trajectory"] = {"range_m": [0.5]}
    first, second = [
        (await client.post("/v1/simulations", json=request_body)).json() for _ in range(2)
    ]
    assert first["seed"] != second["seed"]
    again = (
        await client.post("/v1/simulations", json=request_body | {"seed": first["seed"]})
    ).json()
    assert again == first


async def test_openapi(client: httpx.AsyncClient) -> None:
    document = (await client.get("/openapi.json")).json()
    schemas = document["components"]["schemas"]
    text = json.dumps(document)
    for part in text.split('"#/components/schemas/')[1:]:
        assert part.split('"')[0] in schemas
    for path, operations in document["paths"].items():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if status.startswith(("4", "5")):
                    assert list(response["content"]) == ["application/problem+json"], path
    for route in ("estimates", "identifiability", "posteriors", "simulations"):
        operation = document["paths"][f"/v1/{route}"]["post"]
        assert "requestBody" in operation
        assert {"400", "413", "415", "422"} <= operation["responses"].keys()
