"""Requests that schemathesis makes of the OpenAPI document."""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import httpx

from benchmarks.http_load import served
from benchmarks.resumable import code_version, resume, rows_of
from tests.service import test_fuzz, test_schemathesis

__all__ = ["checked"]

CONFIG = Path(test_fuzz.__file__).with_name("schemathesis.toml")
PIECE = 250
COLUMNS = ("set", "examples", "cases", "seconds", "commit")
"""``examples`` were asked for; ``cases`` schemathesis made of them."""
_CASES = re.compile(r"^\s*([0-9,]+) generated", re.MULTILINE)


class _Part(NamedTuple):
    """Pieces of one table: an operation in some phases, or ways of several requests."""

    name: str
    options: tuple[str, ...]
    examples: int
    pieces: int


def _parts(examples: int, address: str) -> Iterator[_Part]:
    """Return everything that is asked for."""
    document = httpx.get(f"{address}/openapi.json", timeout=60).json()
    pieces = -(-examples // PIECE)
    for path, operations in document["paths"].items():
        if re.match(test_schemathesis.NO_END, path):
            continue
        for method in operations:
            name = f"{method.upper()} {path}"
            options = ("--include-name", name)
            # what it makes of every keyword once needs no further seeds
            each = (*options, "--phases", "examples,coverage")
            yield _Part(f"{name} keywords", each, 1, 1)
            yield _Part(name, (*options, "--phases", "fuzzing"), min(examples, PIECE), pieces)
    several = max(examples // 20, 1)
    chained = ("--exclude-path-regex", test_schemathesis.NO_END, "--phases", "stateful")
    yield _Part("several requests", chained, min(several, 25), -(-several // 25))


def checked(examples: int, only: str, out: Path) -> bool:
    """Run what the tables lack against servers of their own; whether nothing was found."""
    good = True
    with tempfile.TemporaryDirectory() as folder:
        database = {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/jobs.sqlite"}
        with served("tests.service.fake_server", "{}", str(2**23), settings=database) as address:
            for part in _parts(examples, address):
                if only in part.name:
                    good &= _part(part, address, Path(folder), out)
    return good


class _FoundSomethingError(Exception):
    """schemathesis did not end well: what it printed."""


def _part(part: _Part, address: str, folder: Path, out: Path) -> bool:
    def piece(number: int) -> dict[str, str | int | float]:
        began = time.monotonic()
        command = (sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIG))
        limits = ("--max-examples", str(part.examples), "--seed", str(number))
        done = subprocess.run(  # noqa: S603
            (
                *command,
                "run",
                f"{address}/openapi.json",
                *part.options,
                *limits,
                "--continue-on-failure",
            ),
            cwd=folder,
            capture_output=True,
            text=True,
        )
        found = _CASES.search(done.stdout)
        if done.returncode or found is None:
            raise _FoundSomethingError(done.stdout + done.stderr)
        seconds = round(time.monotonic() - began, 1)
        values = (part.examples, int(found[1].replace(",", "")), seconds, code_version())
        return dict(zip(COLUMNS[1:], values, strict=True))

    table = out / f"requests-{re.sub('[^A-Za-z0-9]+', '-', part.name).strip('-')}.csv"
    try:
        resume(table, COLUMNS, range(part.pieces), piece)
    except _FoundSomethingError as error:
        print(f"{part.name}:\n{error}", flush=True)
        return False
    rows = rows_of(table)
    told = {
        "examples": sum(int(row["examples"]) for row in rows),
        "cases": sum(int(row["cases"]) for row in rows),
        "seconds": round(sum(float(row["seconds"]) for row in rows)),
    }
    print(f"{part.name}: {json.dumps(told)}", flush=True)
    return True
