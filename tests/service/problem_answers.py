"""Bad requests, and what their answers have to be."""

import json
from typing import Any

import httpx


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
