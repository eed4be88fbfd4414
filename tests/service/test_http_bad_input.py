"""Bad requests over ASGI: each offending field is named."""

import json
from typing import Any

import httpx
import pytest

from service.app import create_app
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.conftest import JSON
from tests.service.problem_answers import assert_problem, changed

pytestmark = pytest.mark.anyio

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


async def test_readings_of_another_form_are_named_with_what_to_give(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    request_body["frames"] = {"phase": [0.1], "amplitude": [1.5], "distance": [1.0], "spin": [1.0]}
    response = await client.post("/v1/estimates", json=request_body)
    assert response.status_code == 422
    said = {error["pointer"]: error["detail"] for error in response.json()["errors"]}
    for name in ("phase", "amplitude"):
        assert "i = amplitude cos(phase) and q = amplitude sin(phase)" in said[f"/frames/{name}"]
    assert "known_range_m" in said["/frames/distance"]
    assert said["/frames/spin"].startswith("Extra inputs")


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


async def test_simulation_that_overflows(
    client: httpx.AsyncClient, request_body: dict[str, Any]
) -> None:
    del request_body["frames"]
    request_body["trajectory"] = {"range_m": [1e-200]}
    request_body["sensor"]["gain"] = 1e50
    response = await client.post("/v1/simulations", json=request_body)
    assert_problem(response, 422, "/trajectory/range_m/0")
