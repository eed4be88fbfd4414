"""Routes over ASGI, without a network."""

import json
from typing import Any

import httpx
import pytest

from service.answers.estimates import EstimatesResponse
from service.answers.simulations import SimulationResponse
from service.app import create_app
from service.messages import MESSAGES
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.conftest import JSON

pytestmark = pytest.mark.anyio


def assert_problem(response: httpx.Response, status: int, *pointers: str) -> None:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    body = response.json()
    assert body["status"] == status
    assert body["type"].startswith("urn:hybridtof:problem:")
    assert {"title", "detail", "errors"} <= body.keys()
    assert sorted(e["pointer"] for e in body["errors"]) == sorted(pointers), body


def changed(body: dict[str, Any], pointer: str, value: Any) -> dict[str, Any]:
    """Return the body with one member set."""
    body = json.loads(json.dumps(body))
    *path, last = pointer.strip("/").split("/")
    target = body
    for part in path:
        target = target[part]
    target[last] = value
    return body


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
    assert refused.json()["detail"].endswith(
        "scene: conventional: is not immune to crosstalk, and the scene's is unknown"
    )


async def test_conventional_range(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    request_body["techniques"] = ["conventional"]
    response = await client.post("/v1/estimates", json=request_body)
    frame = response.json()["results"][0]["frames"][1]
    r0 = 299_792_458 * 1e-7 / 2
    assert frame["status"] == "unique"
    assert frame["range_m"] == pytest.approx(0.02 / 1.7 * r0, rel=1e-14)
    assert frame["roots_m"] == [frame["range_m"]]


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("pointer", "value", "named"),
    [
        ("/frames/w1", [0.01], "/frames/w2"),
        ("/frames/w1", [], "/frames/w1"),
        ("/frames/w1", [NAN, 1.0], "/frames/w1/0"),
        ("/frames/w2", [1.0, INF], "/frames/w2/1"),
        ("/frames/w2", ["1.5", 1.0], "/frames/w2/0"),
        ("/frames/w2", [1.0, True], "/frames/w2/1"),
        ("/frames/w2", [1.0, None], "/frames/w2/1"),
        ("/frames/w2", [[1.0, 2.0]], "/frames/w2/0"),
        ("/frames/w2", None, "/frames/w2"),
        ("/frames/w3", [1.0, 2.0], "/frames/w3"),
        ("/frames/i", [1.0, 2.0], "/frames/i"),
        ("/frames/gain", [1.0, 0.0], "/frames/gain/1"),
        ("/frames", [], "/frames"),
        ("/sensor/pulse_width_s", True, "/sensor/pulse_width_s"),
        ("/sensor/pulse_width_s", "1e-7", "/sensor/pulse_width_s"),
        ("/sensor/pulse_width_s", 0, "/sensor/pulse_width_s"),
        ("/sensor/kind", "radar", "/sensor/kind"),
        ("/sensor/colour", "red", "/sensor/colour"),
        ("/sensor/noise", {}, "/sensor/noise/read"),
        ("/sensor/noise/read", [1e-6], "/sensor/noise/read/1"),
        ("/scene/object/c0", 0, "/scene/object/c0"),
        ("/scene/object/c1", -1.0, "/scene/object/c1"),
        ("/scene/object/c3", 1.0, "/scene/object/c3"),
        ("/scene/background", {"strength": 1.0}, "/scene/background/distance_m"),
        (
            "/scene/background",
            {"strength": 1.0, "distance_m": 16.0},
            "/scene/background/distance_m",
        ),
        ("/scene/range_m", 1.0, "/scene/range_m"),
        ("/scene", None, "/scene"),
        ("/techniques", ["magic"], "/techniques/0"),
        ("/techniques", [], "/techniques"),
        ("/colour", 1, "/colour"),
    ],
)
async def test_names_the_field(
    client: httpx.AsyncClient,
    request_body: dict[str, Any],
    pointer: str,
    value: Any,
    named: str,
) -> None:
    content = json.dumps(changed(request_body, pointer, value))
    response = await client.post("/v1/estimates", content=content)
    body = response.json()
    assert response.status_code == 422, body
    assert response.headers["content-type"] == "application/problem+json"
    assert named in {e["pointer"] for e in body["errors"]}, body
    assert "NaN" not in response.text
    assert "Infinity" not in response.text


@pytest.mark.parametrize("member", ["sensor", "scene", "frames"])
async def test_missing_member(
    client: httpx.AsyncClient, request_body: dict[str, Any], member: str
) -> None:
    del request_body[member]
    for route in ("estimates", "posteriors"):
        response = await client.post(f"/v1/{route}", json=request_body)
        assert_problem(response, 422, f"/{member}")


async def test_number_without_end(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    content = json.dumps(request_body).replace("0.1]", "1e400]", 1)
    response = await client.post("/v1/estimates", content=content)
    assert_problem(response, 422, "/frames/time_s/1")


async def test_repeated_member(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    content = json.dumps(request_body)[:-1] + ', "scene": {}}'
    response = await client.post("/v1/estimates", content=content)
    assert_problem(response, 422, "/scene")


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


async def test_multitude_of_aliases(client: httpx.AsyncClient) -> None:
    noise = {"read": [1e-6, 1e-6]}
    body = {
        "sensor": {"kind": "sine_wave", "frequency_hz": 1e20, "noise": noise},
        "scene": {"background": {"strength": 1.0, "distance_m": 3.0, "shadow": "object"}},
        "frames": {"i": [0.1], "q": [0.1]},
    }
    assert_problem(await client.post("/v1/estimates", json=body), 422)


async def test_a_null_reading_is_named_with_what_to_do(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    """Columns are good as a whole or refused; of rows one may be bad."""
    request_body["frames"] = {"w1": [0.01, None], "w2": [1.5, 1.7], "known_range_m": [None, "x"]}
    response = await client.post("/v1/estimates", json=request_body)
    assert response.status_code == 422
    said = {error["pointer"]: error["detail"] for error in response.json()["errors"]}
    assert said.keys() == {"/frames/w1/1", "/frames/known_range_m/1"}
    assert said["/frames/w1/1"].startswith("is null: leave that frame out of every column, or send")
    assert "null" not in said["/frames/known_range_m/1"]


async def test_the_root_says_where_to_go(client: httpx.AsyncClient) -> None:
    answer = await client.get("/")
    assert answer.status_code == 200
    told = answer.json()
    described = (await client.get(told["openapi"])).json()
    assert (told["name"], told["version"]) == ("hybridtof", described["info"]["version"])
    assert (await client.get(told["health"])).status_code == 200
    assert {"/v1/estimates", "/v1/posteriors", "/v1/streams"} <= set(told["resources"])
    assert set(told["resources"]) < described["paths"].keys()


@pytest.mark.parametrize("content", [b"", b"{", b"nope", b"\xff\xfe", b"[" * 100_000])
async def test_malformed_body(client: httpx.AsyncClient, content: bytes) -> None:
    for route in ("estimates", "identifiability", "posteriors", "simulations"):
        assert_problem(await client.post(f"/v1/{route}", content=content), 400)


@pytest.mark.parametrize("content", [b"null", b"[]", b"1", b'"x"', b"NaN", b"true"])
async def test_body_that_is_no_object(client: httpx.AsyncClient, content: bytes) -> None:
    for route in ("estimates", "identifiability", "posteriors", "simulations"):
        assert_problem(await client.post(f"/v1/{route}", content=content), 422, "")


async def test_media_type(client: httpx.AsyncClient, request_body: dict[str, Any]) -> None:
    content = json.dumps(request_body)
    for kind in ("application/json", "Application/JSON; charset=utf-8", "application/x+json"):
        response = await client.post(
            "/v1/estimates", content=content, headers={"Content-Type": kind}
        )
        assert response.status_code == 200
    response = await client.post(
        "/v1/estimates", content=content, headers={"Content-Type": "text/csv"}
    )
    assert_problem(response, 415)
    nameless = client.build_request("POST", "/v1/estimates", content=content)
    del nameless.headers["Content-Type"]
    assert_problem(await client.send(nameless), 415)


async def test_unknown_path_and_method(client: httpx.AsyncClient) -> None:
    assert_problem(await client.get("/v1/nothing"), 404)
    assert_problem(await client.get("/v1/estimates/"), 404)
    response = await client.delete("/v1/estimates")
    assert_problem(response, 405)
    assert response.headers["allow"] == "OPTIONS, POST"


async def test_body_too_large(request_body: dict[str, Any]) -> None:
    app = create_app(ServiceSettings(workers=1, max_body_bytes=1000), fake_fold)
    transport = httpx.ASGITransport(app)
    address = "http://localhost"
    async with httpx.AsyncClient(transport=transport, base_url=address, headers=JSON) as small:
        assert (await small.post("/v1/estimates", json=request_body)).status_code == 200
        request_body["frames"] |= {"w1": [0.5] * 1000}
        assert_problem(await small.post("/v1/estimates", json=request_body), 413)

        async def pieces() -> Any:  # no Content-Length
            for _ in range(100):
                yield b" " * 100

        assert_problem(await small.post("/v1/estimates", content=pieces()), 413)
        for declared, status in (("x", 400), ("9" * 30, 413), ("1001", 413)):
            headers = {"Content-Length": declared}
            response = await small.post("/v1/estimates", content=b"{}", headers=headers)
            assert_problem(response, status)


async def test_many_mistakes_are_cut_short(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    for part in ("sensor", "scene", "frames"):
        request_body[part] |= {f"unknown_{n}": 1 for n in range(50)}
    request_body["sensor"]["k" * 5000] = 1
    response = await client.post("/v1/estimates", json=request_body)
    assert response.status_code == 422
    assert len(response.json()["errors"]) == 100
    assert len(response.content) < 100_000


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


async def test_simulation_that_overflows(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    del request_body["frames"]
    request_body["trajectory"] = {"range_m": [1e-200]}
    request_body["sensor"]["gain"] = 1e50
    response = await client.post("/v1/simulations", json=request_body)
    assert_problem(response, 422, "/trajectory/range_m/0")


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
