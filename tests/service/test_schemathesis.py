"""Answers are what OpenAPI says, for requests that are made of it; `make fuzz` makes many more."""

import subprocess
import sys
from pathlib import Path

import anyio
import pytest

from service.app import create_app
from service.service_settings import ServiceSettings
from tests.service import fake_fold
from tests.service.conftest import listening

pytestmark = [pytest.mark.anyio, pytest.mark.slow]

CONFIG = Path(__file__).with_name("schemathesis.toml")
# watching a stream has no end, and it writes no lines of JSON: tests/service/test_streams.py
NO_END = "/v1/streams/.*/(events|frames)"


async def test_answers_are_what_the_document_says(tmp_path: Path) -> None:
    """All checks, with a seed: a finding of random requests belongs to `make fuzz`."""
    fake_fold.order()
    async with listening(create_app(ServiceSettings(workers=1), fake_fold)) as address:
        command = (sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIG))
        options = ("--phases", "examples,fuzzing", "--max-examples", "5", "--seed", "1")
        told = await anyio.run_process(
            (
                *command,
                "run",
                f"http://{address}/openapi.json",
                *options,
                "--exclude-path-regex",
                NO_END,
            ),
            cwd=tmp_path,
            check=False,
            stderr=subprocess.STDOUT,
        )
    assert told.returncode == 0, told.stdout.decode()
