"""The service under bodies that nobody meant: schemathesis, then bodies that are nearly valid.

    python -m benchmarks.fuzz [--examples 2000] [--bodies 10000] [--only WORD]

schemathesis makes requests of the OpenAPI document and holds every answer to it, all checks, for a
service whose posteriors are quick fakes. Nearly valid bodies (tests/service/test_fuzz.py) go to
every route that takes any, also to streams line by line and to UM-Bridge: no 500, nothing that is
not finite, nothing beyond 5 s of processor time; of posteriors everything is computed that comes
before the first draw. Ends with exit code 1 where one is.
"""

import argparse
import asyncio
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import hypothesis
from hypothesis import HealthCheck, Phase, given

from benchmarks.http_load import served
from tests.service import fuzz_bodies, test_fuzz, test_schemathesis

Body = dict[str, Any]

LIMIT_S = 5.0
# what an answer says of a request that was given up; UM-Bridge has errors of its own
OVERDUE = re.compile(r'"type": ?"[^"]*overdue"|send fewer frames"')
CONFIG = Path(test_fuzz.__file__).with_name("schemathesis.toml")


def checked(examples: int, phases: str) -> int:
    """Run schemathesis against a server of its own; its exit code."""
    with tempfile.TemporaryDirectory() as folder:
        database = {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/jobs.sqlite"}
        with served("tests.service.fake_server", "{}", str(2**23), settings=database) as address:
            command = (sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIG))
            limits = ("--phases", phases, "--max-examples", str(examples))
            options = (*limits, "--exclude-path-regex", test_schemathesis.NO_END)
            document = f"{address}/openapi.json"
            return subprocess.run(  # noqa: S603
                (*command, "run", document, *options, "--continue-on-failure"), cwd=folder
            ).returncode


class Target(NamedTuple):
    """Where nearly valid bodies go: path, good bodies, and what an answer has to be.

    ``send`` takes a client, a path and a body, and returns its answer.
    """

    path: str
    bodies: Sequence[Body]
    check: Callable[[httpx.Response], None]
    send: Callable[[httpx.AsyncClient, str, Body], Coroutine[Any, Any, httpx.Response]]


async def _post(http: httpx.AsyncClient, path: str, body: Body) -> httpx.Response:
    return await http.post(path, content=json.dumps(body).encode())


async def _post_line(http: httpx.AsyncClient, path: str, body: Body) -> httpx.Response:
    """Send a line to a stream of its own between two good ones."""
    lines = (fuzz_bodies.LINE, body, fuzz_bodies.LINE)
    made = await http.post("/v1/streams", content=json.dumps(fuzz_bodies.STREAM).encode())
    place = made.headers["Location"]
    content = "\n".join(map(json.dumps, lines)).encode()
    kind = {"Content-Type": "application/x-ndjson"}
    answer = await http.post(path.format(place=place), content=content, headers=kind)
    await http.delete(place)
    return answer


async def _make_stream(http: httpx.AsyncClient, path: str, body: Body) -> httpx.Response:
    """Make a stream, and forget it."""
    answer = await _post(http, path, body)
    if answer.status_code == 201:
        await http.delete(answer.headers["Location"])
    return answer


def targets() -> list[Target]:
    """Return every route that takes a body."""
    needed = {"/v1/simulations": "trajectory", "/v1/identifiability": "ranges_m"}
    found = []
    for route in test_fuzz.ROUTES:
        bodies = [body for body in test_fuzz.BODIES if needed.get(route, "frames") in body]
        if route == "/v1/posteriors":
            bodies = [{k: v for k, v in body.items() if k != "techniques"} for body in bodies]
        found.append(Target(route, bodies, test_fuzz.check, _post))
    streams, lines = fuzz_bodies.STREAMS, fuzz_bodies.LINES
    found.append(Target("/v1/streams", streams, test_fuzz.check, _make_stream))
    found.append(Target("{place}/frames", lines, fuzz_bodies.check_lines, _post_line))
    for operation, asked in fuzz_bodies.MODELS.items():
        path = f"/umbridge/{operation}"
        found.append(Target(path, asked, fuzz_bodies.check_model, _post))
    return found


def nearly_valid(target: Target, count: int, loop: asyncio.Runner, http: httpx.AsyncClient) -> bool:
    """Send bodies to a route; whether every answer was as it should be, and in time."""
    statuses: dict[int, int] = {}
    slowest = [(0.0, "")]

    @hypothesis.settings(
        deadline=None,
        database=None,
        max_examples=count,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(
        body=test_fuzz.spoiled(test_fuzz.anything, target.bodies)
        | test_fuzz.spoiled(test_fuzz.numbers, target.bodies)
    )
    def send(body: Body) -> None:
        began = time.process_time()
        answer = loop.run(target.send(http, target.path, body))
        seconds = time.process_time() - began
        if OVERDUE.search(answer.text):
            seconds = LIMIT_S
        slowest[0] = max(slowest[0], (seconds, json.dumps(body)))
        statuses[answer.status_code] = statuses.get(answer.status_code, 0) + 1
        target.check(answer)

    send()
    ((seconds, content),) = slowest
    told = ", ".join(f"{n} times {status}" for status, n in sorted(statuses.items()))
    print(f"{target.path}: {told}; slowest {seconds:.2f} s: {content[:400]}", flush=True)
    return seconds < LIMIT_S


def sent(target: Target, count: int) -> bool:
    """Send bodies to a route of an application of its own."""
    with (
        tempfile.TemporaryDirectory() as folder,
        asyncio.Runner() as loop,
        test_fuzz.answering(
            loop, database=f"sqlite:///{folder}/jobs.sqlite", request_s=LIMIT_S
        ) as http,
    ):
        return nearly_valid(target, count, loop, http)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=2000, help="of schemathesis, a route")
    parser.add_argument("--bodies", type=int, default=10_000, help="nearly valid, a route")
    parser.add_argument("--only", default="", help="nearly valid bodies to routes that hold this")
    args = parser.parse_args()
    failed = 0
    if args.examples:
        failed = checked(args.examples, "examples,coverage,fuzzing")
        # ways of several requests each
        failed |= checked(max(args.examples // 20, 1), "stateful")
    chosen = [target for target in targets() if args.bodies and args.only in target.path]
    good = [sent(target, args.bodies) for target in chosen]
    return 1 if failed or not all(good) else 0


if __name__ == "__main__":
    sys.exit(main())
