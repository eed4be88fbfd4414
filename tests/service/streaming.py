"""What tests of streams share: frames, addresses, answers."""

import json
from typing import Any

import httpx

from benchmarks.streams import lines_of

NDJSON = {"Content-Type": "application/x-ndjson"}

LINES = lines_of(12)


async def sent(http: httpx.AsyncClient, path: str, *lines: bytes) -> list[dict[str, Any]]:
    body = b"\n".join(lines)
    response = await http.post(path + "/frames", content=body, headers=NDJSON)
    assert response.status_code == 200, response.text
    assert response.headers["Content-Type"] == "application/x-ndjson"
    return [json.loads(line) for line in response.text.splitlines()]


def plain(answers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{k: v for k, v in answer.items() if k != "latency_s"} for answer in answers]
