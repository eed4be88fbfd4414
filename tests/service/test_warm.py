"""Machine code ahead of the first question."""

import argparse
from functools import partial
from pathlib import Path

import httpx
import pytest

from service.app import create_app
from service.cli import main
from service.commands.warm import warm
from service.service_settings import ServiceSettings
from service.warm.questions import QUESTIONS
from service.warm.warming import Warming, is_warm


@pytest.fixture
def asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Have two questions, an empty cache, and a list of what is asked."""
    said: list[str] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    questions = {name: lambda name=name: said.append(name) for name in ("one", "two")}
    monkeypatch.setattr("service.warm.questions.QUESTIONS", questions)
    return said


def test_the_cache_is_warmed_once_and_says_how_far(
    asked: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert not is_warm()
    assert main(["warm"]) == 0
    assert asked == ["one", "two"]
    assert "compiling 2 of 2: two" in capsys.readouterr().err
    assert is_warm()
    assert main(["warm", "--quiet"]) == 0
    assert asked == ["one", "two"]
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("asked")
def test_no_cache_cannot_be_warmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert main(["warm"]) == 4
    assert "NUMBA_CACHE_DIR" in capsys.readouterr().err


@pytest.mark.anyio
async def test_ready_says_that_it_warms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    warming = Warming(partial(warm, argparse.Namespace(quiet=True)))
    app = create_app(ServiceSettings(workers=1), warming=warming)
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost") as client,
    ):
        assert (await client.get("/health/ready")).json() == {"status": "warming"}
        warming.end()
        assert (await client.get("/health/ready")).json() == {"status": "ok"}
    assert not warming.going


@pytest.mark.parametrize(
    "name", [name for name in QUESTIONS if "_fit" not in name and "posterior" not in name]
)
def test_questions_about_single_frames_and_streams_have_answers(name: str) -> None:
    assert QUESTIONS[name]() != ()
