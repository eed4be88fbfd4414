"""What a route has by being in the registry: methods, refusals, a place in OpenAPI."""

from typing import Annotated, Any

import httpx
import pytest
from fastapi import APIRouter, Depends
from fastapi.routing import APIRoute, APIWebSocketRoute

from service import app as application
from service.app import create_app
from service.bodies import BodyOf
from service.problems import problem_responses
from service.routes import ROUTERS
from service.service_settings import ServiceSettings
from simulator.validated import Validated
from tests.service.conftest import JSON

pytestmark = pytest.mark.anyio


def routes() -> dict[str, set[str]]:
    """Methods of every path."""
    found: dict[str, set[str]] = {}
    for router in ROUTERS:
        for route in router.routes:
            if isinstance(route, APIWebSocketRoute):  # which has no methods
                continue
            assert isinstance(route, APIRoute)
            found.setdefault(route.path_format, set()).update(route.methods or ())
    return found


async def test_other_methods_are_refused_with_those_that_are_allowed(
    client: httpx.AsyncClient,
) -> None:
    for path, methods in routes().items():
        response = await client.request("PATCH", path.replace("{job_id}", "x"))
        assert response.status_code == 405
        assert response.headers["content-type"] == "application/problem+json"
        allowed = methods | {"OPTIONS"} | ({"HEAD"} if "GET" in methods else set())
        assert set(response.headers["allow"].split(", ")) == allowed
        asked = await client.options(path.replace("{job_id}", "x"))
        assert (asked.status_code, asked.content) == (204, b"")
        assert asked.headers["allow"] == response.headers["allow"]


async def test_the_document_has_every_route(client: httpx.AsyncClient) -> None:
    """But those of UM-Bridge, which describes itself."""
    paths = (await client.get("/openapi.json")).json()["paths"]
    own = {path: ways for path, ways in routes().items() if not path.startswith("/umbridge/")}
    assert {path: {method.upper() for method in ways} for path, ways in paths.items()} == own
    for path, ways in paths.items():
        for way in ways.values():
            assert {"403", "421"} <= way["responses"].keys()
            assert ("401" in way["responses"]) == ("security" in way) == ("/health/" not in path)
            assert ("requestBody" not in way) or {"408", "415", "503"} <= way["responses"].keys()


class Question(Validated):
    """What a stranger's route is asked."""

    number: float


router = APIRouter(prefix="/v1/halves", tags=["halves"])


@router.post("", responses=problem_responses(400, 413, 415, 422))
async def create(
    body: Annotated[tuple[Question, bytes], Depends(BodyOf(Question))],
) -> dict[str, float]:
    """Halve a number."""
    return {"half": body[0].number / 2}


async def test_a_new_route_is_a_file_and_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(application, "ROUTERS", (*ROUTERS, router))
    transport = httpx.ASGITransport(create_app(ServiceSettings(workers=1)))
    async with httpx.AsyncClient(
        transport=transport, base_url="http://localhost", headers=JSON
    ) as http:
        good = await http.post("/v1/halves", json={"number": 3.0})
        assert (good.status_code, good.json()) == (200, {"half": 1.5})
        answers = {
            422: await http.post("/v1/halves", json={"number": "3", "colour": 1}),
            400: await http.post("/v1/halves", content=b"{"),
            415: await http.post("/v1/halves", content=b"{}", headers={"Content-Type": "a/b"}),
            405: await http.get("/v1/halves"),
        }
        for status, answer in answers.items():
            assert answer.status_code == status
            assert answer.headers["content-type"] == "application/problem+json"
        pointers = [error["pointer"] for error in answers[422].json()["errors"]]
        assert pointers == ["/number", "/colour"]
        document: dict[str, Any] = (await http.get("/openapi.json")).json()
    operation = document["paths"]["/v1/halves"]["post"]
    schema = operation["requestBody"]["content"]["application/json"]["schema"]
    assert schema == {"$ref": "#/components/schemas/Question"}
    assert document["components"]["schemas"]["Question"]["required"] == ["number"]
