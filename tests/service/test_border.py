"""What is let in, and how answers are dressed: over a socket."""

import json
import logging
import re
from collections.abc import AsyncIterator
from typing import Any

import pytest

from service.app import create_app
from service.border.authorities import is_loopback
from service.logs import JsonLines
from service.service_settings import ServiceSettings
from simulator.errors import InvalidInputError
from tests.service import fake_fold
from tests.service.conftest import JSON, listening, speaking, told

pytestmark = pytest.mark.anyio


@pytest.fixture
async def address() -> AsyncIterator[str]:
    fake_fold.order()
    settings = ServiceSettings.from_environment(
        {"HYBRIDTOF_WORKERS": "1", "HYBRIDTOF_ALLOWED_HOSTS": "range.example, 2001:db8::1"}
    )
    async with listening(create_app(settings, fake_fold)) as found:
        yield found


def problem(answer: tuple[int, dict[str, str], bytes]) -> tuple[int, str]:
    status, headers, content = answer
    assert headers["content-type"] == "application/problem+json"
    body = json.loads(content)
    assert body["status"] == status
    return status, body["type"].rpartition(":")[2]


async def test_names(address: str) -> None:
    """A name that was made to point here (DNS rebinding) is not one of the service's."""
    port = address.rpartition(":")[2]
    for host in ("localhost", address, f"[::1]:{port}", "LOCALHOST.", "127.0.0.7", "Range.Example",
                 f"range.example:{port}", "[2001:db8::1]:80"):  # fmt: skip
        status, *_ = await told(address, "GET /health/live HTTP/1.1", f"Host: {host}")
        assert status == 200, host
    for host in ("evil.example", f"evil.example:{port}", "localhost.evil.example", "",
                 "127.0.0.1@x", "10.0.0.1", "[2001:db8::2]", "range.example.evil"):  # fmt: skip
        answer = await told(address, "GET /health/live HTTP/1.1", f"Host: {host}")
        assert problem(answer) == (421, "misdirected"), host
    assert (await told(address, "GET /health/live HTTP/1.0"))[0] == 421


async def test_pages_of_others(address: str, request_body: dict[str, Any]) -> None:
    """What a browser sends for a page of another site, form or script, is refused."""
    body = json.dumps(request_body).encode()
    lines = ("POST /v1/posteriors HTTP/1.1", f"Host: {address}", "Content-Type: application/json")
    sized = (*lines, f"Content-Length: {len(body)}")
    for header in ("Origin: https://evil.example", "Origin: null", "Sec-Fetch-Site: cross-site",
                   "Origin: http://127.0.0.1:1", f"Origin: ftp://{address}"):  # fmt: skip
        answer = await told(address, *sized, header, body=body)
        assert problem(answer) == (403, "foreign"), header
    for header in (f"Origin: http://{address}", "Sec-Fetch-Site: same-origin", "X-None: 1"):
        assert (await told(address, *sized, header, body=body))[0] == 202, header
    listed = await told(address, "GET /v1/posteriors HTTP/1.1", f"Host: {address}")
    assert len(json.loads(listed[2])["items"]) == 3
    socket = ("GET /live HTTP/1.1", f"Host: {address}", "Upgrade: websocket")
    assert (await told(address, *socket, "Origin: https://evil.example"))[0] == 403


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Content-Type": 'application/json; charset="UTF-8"'}, 200),
        ({"Content-Type": "application/json; profile=x", "Content-Encoding": "identity"}, 200),
        ({}, 415),
        ({"Content-Type": ""}, 415),
        ({"Content-Type": "application/json; charset=latin-1"}, 415),
        ({"Content-Type": "application/json; charset=utf-16"}, 415),
        ({"Content-Type": "text/plain; application/json"}, 415),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415),
        (JSON | {"Content-Encoding": "gzip"}, 415),
        (JSON | {"Content-Encoding": "identity, br"}, 415),
    ],
)
async def test_what_the_body_is(
    address: str, request_body: dict[str, Any], headers: dict[str, str], status: int
) -> None:
    body = json.dumps(request_body).encode()
    lines = [f"{name}: {value}" for name, value in headers.items()]
    length = f"Content-Length: {len(body)}"
    first = ("POST /v1/estimates HTTP/1.1", f"Host: {address}", length)
    answer = await told(address, *first, *lines, body=body)
    assert answer[0] == status
    if status == 415:
        assert problem(answer) == (415, "media-type")
        assert answer[1]["accept-encoding"] == "identity"


async def test_head(address: str, request_body: dict[str, Any]) -> None:
    """Where GET is, with its headers, and with an end where GET has none."""
    async with speaking(f"http://{address}") as http:
        for path in ("/health/live", "/v1/techniques", "/v1/posteriors", "/openapi.json"):
            got, head = await http.get(path), await http.head(path)
            assert (got.status_code, head.status_code) == (200, 200)
            assert head.content == b""
            for name in ("content-type", "content-length"):
                assert head.headers[name] == got.headers[name]
        made = (await http.post("/v1/posteriors", json=request_body)).headers["location"]
        assert (await http.head(made)).status_code == 200
        events = await http.head(made + "/events")
        assert events.headers["content-type"].startswith("text/event-stream")
        refused = await http.head("/v1/estimates")
        assert (refused.status_code, refused.headers["allow"]) == (405, "OPTIONS, POST")
        assert (await http.head("/v1/nothing")).status_code == 404


async def test_every_answer_is_dressed(address: str) -> None:
    async with speaking(f"http://{address}") as http:
        answers = [
            await http.get("/health/live"),
            await http.get("/v1/nothing"),
            await http.options("/v1/estimates"),
            await http.post("/v1/estimates", content=b"{", headers=JSON),
            await http.get("/health/live", headers={"Host": "evil.example"}),
        ]
        for answer in answers:
            assert answer.headers["x-content-type-options"] == "nosniff"
            assert answer.headers["content-security-policy"].startswith("default-src 'none'")
            assert answer.headers["cache-control"] == "no-store"
            assert "access-control-allow-origin" not in answer.headers
        for path in ("/docs", "/redoc", "/docs/oauth2-redirect"):
            assert (await http.get(path)).status_code == 404


@pytest.mark.parametrize(
    ("name", "own"),
    [("localhost", True), ("127.1.2.3", True), ("[::1]", True), ("::1", True), ("::", False),
     ("", False), ("10.0.0.1", False), ("localhost.evil.example", False)],
)  # fmt: skip
def test_loopback(name: str, own: bool) -> None:
    assert is_loopback(name) is own


@pytest.mark.parametrize("text", ["http://range.example", "a b", "x/y", "range.example:80"])
def test_hosts_that_are_none(text: str) -> None:
    with pytest.raises(InvalidInputError, match="HYBRIDTOF_ALLOWED_HOSTS"):
        ServiceSettings.from_environment({"HYBRIDTOF_ALLOWED_HOSTS": text})


async def test_traces(address: str, request_body: dict[str, Any]) -> None:
    """A line and a count for every request, and nothing in them of what was said."""
    records: list[logging.LogRecord] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            records.append(record)

    handler = Kept()
    log = logging.getLogger("hybridtof.requests")
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    word = {"Authorization": "Bearer secret-word", "X-Request-ID": "mine-7"}
    async with speaking(f"http://{address}") as http:
        answer = await http.get("/v1/posteriors?cursor=secret-word", headers=word)
        assert answer.headers["x-request-id"] == "mine-7"
        odd = await http.get("/v1/posteriors/secret-word", headers={"X-Request-ID": 'a"b'})
        assert len(odd.headers["x-request-id"]) == 32
        await http.request("SECRET-WORD", "/secret-word")
        assert (await http.post("/v1/posteriors", json=request_body)).status_code == 202
        counts = (await http.get("/metrics")).text
    log.removeHandler(handler)
    lines = [JsonLines().format(record) for record in records]
    assert [json.loads(line)["status"] for line in lines] == [400, 404, 404, 202, 200]
    assert "secret-word" not in "".join(lines).lower() + counts.lower()
    for line in (
        'hybridtof_requests_total{method="GET",route="/v1/posteriors/{job_id}",status="404"} 1.0',
        'hybridtof_requests_total{method="other",route="none",status="404"} 1.0',
        'hybridtof_request_seconds_count{route="/v1/posteriors"} 2.0',
        "hybridtof_requests_open 1.0",
    ):
        assert line in counts
    assert re.search(r'hybridtof_posteriors\{status="[a-z]+"\} 1.0', counts)
