"""API keys: two that know nothing of one another, over a socket; and the command for them."""

import asyncio
import json
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets import ConnectionClosed, connect

from benchmarks.streams import system
from service.app import create_app
from service.border.keys import KeyRing, read_keys
from service.cli import main
from service.service_settings import ServiceSettings
from simulator.errors import InvalidInputError
from tests.service import fake_fold
from tests.service.conftest import listening, speaking
from tests.service.streaming import LINES, NDJSON

pytestmark = pytest.mark.anyio


class Said:
    """What ``hybridtof keys`` said, and how it ended."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *arguments: object) -> None:
        self.code = main(["keys", *map(str, arguments)])
        self.out, self.err = capsys.readouterr()

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "folder" / "keys.json"
    monkeypatch.setenv("HYBRIDTOF_API_KEYS", str(path))
    return path


@pytest.fixture
def secrets(file: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    assert not file.exists()
    return [Said(capsys, "create", name).json["key"] for name in ("one", "two")]


@pytest.fixture
async def address(file: Path, secrets: list[str]) -> AsyncIterator[str]:
    assert len(secrets) == 2
    fake_fold.order()
    async with listening(create_app(ServiceSettings(workers=1, api_keys=file), fake_fold)) as found:
        yield f"http://{found}"


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


async def test_strangers(address: str, secrets: list[str]) -> None:
    """Without a key nothing but health; a key counts as a bearer's token and as a password."""
    wrong = secrets[0][:-1] + ("A" if secrets[0][-1] != "A" else "B")
    async with speaking(address) as http:
        for path in ("/health/live", "/health/ready"):
            assert (await http.get(path)).status_code == 200
        for path in ("/v1/techniques", "/v1/posteriors", "/openapi.json", "/metrics", "/nothing"):
            for headers in ({}, bearer(wrong), bearer("x"), {"Authorization": "Basic !"},
                            {"Authorization": secrets[0]}):  # fmt: skip
                answer = await http.get(path, headers=headers)
                assert answer.status_code == 401
                assert answer.headers["www-authenticate"].startswith("Bearer")
                assert answer.headers["content-type"] == "application/problem+json"
                assert wrong not in answer.text
        for secret in secrets:
            assert (await http.get("/v1/techniques", headers=bearer(secret))).status_code == 200
            word = httpx.BasicAuth("anybody", secret)
            assert (await http.get("/v1/techniques", auth=word)).status_code == 200


async def test_jobs_belong_to_their_key(
    address: str, secrets: list[str], request_body: dict[str, Any]
) -> None:
    async with (
        speaking(address, bearer(secrets[0])) as one,
        speaking(address, bearer(secrets[1])) as two,
    ):
        same = {"Idempotency-Key": "the-same"}
        mine = await one.post("/v1/posteriors", json=request_body, headers=same)
        path = mine.headers["location"]
        assert (await two.get("/v1/posteriors")).json()["items"] == []
        for method, way in (("GET", ""), ("GET", "/events"), ("GET", "/draws"), ("HEAD", ""),
                            ("POST", "/cancel"), ("DELETE", "")):  # fmt: skip
            hidden = await two.request(method, path + way)
            none = await two.request(method, "/v1/posteriors/0123456789abcdef" + way)
            assert (hidden.status_code, hidden.content) == (404, none.content), way
        # the key of a request is the owner's own
        request_body["sampler"] = {"seed": 9}
        other = await two.post("/v1/posteriors", json=request_body, headers=same)
        assert (other.status_code, other.headers["location"] != path) == (202, True)
        assert [job["id"] for job in (await one.get("/v1/posteriors")).json()["items"]] == [
            mine.json()["id"]
        ]
        assert (await one.get(path + "/events")).text.count("data: ")  # until it has ended
        assert (await one.get(path)).json()["status"] == "done"
        assert (await one.get(path + "/draws")).status_code == 200
        assert (await one.delete(path)).status_code == 204


async def test_revoked_and_changed_while_it_runs(
    address: str, file: Path, secrets: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    async with speaking(address) as http:
        assert Said(capsys, "revoke", "one").code == 0
        assert (await http.get("/metrics", headers=bearer(secrets[0]))).status_code == 401
        assert (await http.get("/metrics", headers=bearer(secrets[1]))).status_code == 200
        third = Said(capsys, "create", "one").json["key"]
        assert (await http.get("/metrics", headers=bearer(third))).status_code == 200
        file.unlink()  # then nobody is known
        assert (await http.get("/metrics", headers=bearer(third))).status_code == 401


async def test_who_is_revoked_is_out_of_what_is_open(
    address: str,
    secrets: list[str],
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A connection that lasts went on for as long as its client liked."""
    monkeypatch.setattr("fastapi.routing._PING_INTERVAL", 0.1)
    first, second = LINES[:2]
    async with speaking(address, bearer(secrets[0])) as one:
        sent_to, followed, live = [
            (await one.post("/v1/streams", json=system())).headers["location"] for _ in range(3)
        ]
        revoked, told = asyncio.Event(), asyncio.Event()

        async def lines() -> AsyncIterator[bytes]:
            yield first + b"\n"
            await revoked.wait()
            yield second + b"\n"

        async def send() -> bytes:
            body = lines()
            answer = await one.post(sent_to + "/frames", content=body, headers=NDJSON)
            return answer.content

        async def follow() -> int:
            events = 0
            async with one.stream("GET", followed + "/events") as response:
                async for line in response.aiter_lines():
                    events += line.startswith("data:")
                    told.set()
            return events

        async with (
            asyncio.timeout(600.0),  # a clock knows no load
            connect(f"ws{address.removeprefix('http')}{live}/live",
                    additional_headers=bearer(secrets[0])) as socket,
        ):  # fmt: skip
            sending, following = asyncio.create_task(send()), asyncio.create_task(follow())
            await one.post(followed + "/frames", content=first, headers=NDJSON)
            await socket.send(first.decode())
            assert json.loads(await socket.recv())["sequence"] == 1
            await told.wait()
            while (await one.get(sent_to)).json()["sequence"] is None:
                await asyncio.sleep(0.01)
            assert Said(capsys, "revoke", "one").code == 0
            revoked.set()
            await socket.send(second.decode())
            with pytest.raises(ConnectionClosed) as closed:
                await socket.recv()
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1008
            assert len((await sending).splitlines()) == 1
            assert await following == 1
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_command(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = Said(capsys, "create", "laboratory")
    secret = made.json["key"]
    # 32 bytes, six bits a character
    assert len(secret.removeprefix("ht_")) == 43
    assert (made.code, file.stat().st_mode & 0o777) == (0, 0o600)
    assert secret not in file.read_text()
    assert secret not in made.err
    listed = Said(capsys, "list")
    assert [key["name"] for key in listed.json["keys"]] == ["laboratory"]
    assert "sha256" not in listed.out
    for wrong in (("create", "laboratory"), ("create", "a b"), ("create",), ("list", "x"),
                  ("revoke", "nobody"), ("revoke",)):  # fmt: skip
        said = Said(capsys, *wrong)
        assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert Said(capsys, "revoke", made.json["id"]).code == 0
    assert Said(capsys, "list", "--file", file).json["keys"] == []
    with pytest.raises(InvalidInputError, match="has no keys"):
        KeyRing(file)
    assert os.listdir(file.parent) == ["keys.json"]  # noqa: PTH208


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        ("mode", "others can read or write"),
        ("text", "is no file of keys"),
        ("shape", "is no file of keys"),
        ("gone", "No such file"),
    ],
)
def test_a_file_that_is_no_secret_ends_the_start(
    file: Path, secrets: list[str], capsys: pytest.CaptureFixture[str], spoil: str, why: str
) -> None:
    assert len(read_keys(file)) == len(secrets)
    if spoil == "mode":
        file.chmod(0o640)
    elif spoil == "gone":
        file.unlink()
    else:
        file.write_text({"text": "{", "shape": '{"keys": [{"x": 1}]}'}[spoil])
    with pytest.raises(InvalidInputError, match="/HYBRIDTOF_API_KEYS"):
        KeyRing(file)  # before a server starts, which would not end
    assert main(["serve", "--port", "0"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("hybridtof: error: /HYBRIDTOF_API_KEYS: ")
    assert why in said
    assert said.count("\n") == 1


def test_no_stranger_without_keys(capsys: pytest.CaptureFixture[str]) -> None:
    """Where others can reach it, it does not start without keys."""
    for host in ("0.0.0.0", "::", "192.0.2.1", "range.example"):  # noqa: S104  (refused)
        assert main(["serve", "--host", host, "--port", "0"]) == 2
        said = capsys.readouterr().err
        assert "/HYBRIDTOF_API_KEYS: is needed" in said
        assert said.count("\n") == 1
