"""Bodies that are nearly valid, to every route that takes any."""

import asyncio
import json
import re
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import hypothesis
from hypothesis import HealthCheck, Phase, given

from benchmarks.resumable import code_version, resume, rows_of
from tests.service import fuzz_bodies, test_fuzz

__all__ = ["Found", "Target", "nearly_valid", "sent", "targets"]

Body = dict[str, Any]

LIMIT_S = 5.0
PIECE = 200
COLUMNS = ("set", "bodies", "statuses", "slowest_s", "slowest", "commit")
# what an answer says of a request that was given up; UM-Bridge has errors of its own
OVERDUE = re.compile(r'"type": ?"[^"]*overdue"|send fewer frames"')


class Target(NamedTuple):
    """Where nearly valid bodies go: path, good bodies, and what an answer has to be.

    ``send`` takes a client, a path and a body, and returns its answer.
    """

    path: str
    bodies: Sequence[Body]
    check: Callable[[httpx.Response], None]
    send: Callable[[httpx.AsyncClient, str, Body], Coroutine[Any, Any, httpx.Response]]


class Found(NamedTuple):
    """What came of some bodies: statuses, the longest processor time [s], and its body."""

    statuses: Counter[int]
    slowest_s: float
    slowest: str


async def _post(http: httpx.AsyncClient, path: str, body: Body) -> httpx.Response:
    return await http.post(path, content=json.dumps(body).encode())


class _Lines:
    """Sends a line to a stream between two good ones; a stream serves until a line has spoilt it.

    A line may say a number or a time from which no further good line follows: the next one then has
    a stream of its own. What a line leaves as it was good moves on with the stream.
    """

    def __init__(self) -> None:
        self._place: str | None = None
        self._answered = 0

    async def send(self, http: httpx.AsyncClient, path: str, body: Body) -> httpx.Response:
        if self._place is None:
            made = await http.post("/v1/streams", content=json.dumps(fuzz_bodies.STREAM).encode())
            self._place, self._answered = made.headers["Location"], 0
        first = self._answered + 1
        lines = [fuzz_bodies.LINE | {"time_s": 0.1 * (first + at)} for at in range(3)]
        good = fuzz_bodies.LINES[0]
        moved = {"time_s": lines[1]["time_s"], "sequence": first + 1}
        lines[1] = body | {
            name: value
            for name, value in moved.items()
            if type(body.get(name)) is type(good[name]) and body[name] == good[name]
        }
        content = "\n".join(map(json.dumps, lines)).encode()
        kind = {"Content-Type": "application/x-ndjson"}
        place = path.format(place=self._place)
        answer = await http.post(place, content=content, headers=kind)
        last = json.loads(answer.content.splitlines()[-1]) if answer.content else {"error": ""}
        self._answered += 3
        if "error" in last or last["sequence"] != self._answered:
            await http.delete(self._place)
            self._place = None
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
    found.append(Target("{place}/frames", lines, fuzz_bodies.check_lines, _Lines().send))
    for operation, asked in fuzz_bodies.MODELS.items():
        path = f"/umbridge/{operation}"
        found.append(Target(path, asked, fuzz_bodies.check_model, _post))
    return found


def nearly_valid(
    target: Target, count: int, loop: asyncio.Runner, http: httpx.AsyncClient, seed: int = 0
) -> Found:
    """Send so many bodies to a route, and hold every answer to what it has to be."""
    statuses: Counter[int] = Counter()
    slowest = [(0.0, "")]

    @hypothesis.seed(seed)
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
        statuses[answer.status_code] += 1
        target.check(answer)

    send()
    return Found(statuses, *slowest[0])


def sent(target: Target, count: int, out: Path) -> bool:
    """Send what a route's table lacks to an application of its own; whether all was in time."""
    table = out / f"bodies-{target.path.strip('{}/').replace('/', '-').replace('}', '')}.csv"
    pieces = range(-(-count // PIECE))
    with (
        tempfile.TemporaryDirectory() as folder,
        asyncio.Runner() as loop,
        test_fuzz.answering(
            loop, database=f"sqlite:///{folder}/jobs.sqlite", request_s=LIMIT_S
        ) as http,
    ):

        def piece(number: int) -> dict[str, str | int | float]:
            found = nearly_valid(target, PIECE, loop, http, number)
            told = " ".join(f"{status}:{n}" for status, n in sorted(found.statuses.items()))
            values = (found.statuses.total(), told, found.slowest_s, found.slowest)
            return dict(zip(COLUMNS[1:], (*values, code_version()), strict=True))

        resume(table, COLUMNS, pieces, piece)
    return _told(target.path, table)


def _told(path: str, table: Path) -> bool:
    """Say what a table holds of a route; whether all was in time."""
    rows = rows_of(table)
    statuses: Counter[str] = Counter()
    for row in rows:
        for part in row["statuses"].split():
            status, n = part.split(":")
            statuses[status] += int(n)
    slowest = max(rows, key=lambda row: float(row["slowest_s"]))
    seconds = float(slowest["slowest_s"])
    told = ", ".join(f"{n} times {status}" for status, n in sorted(statuses.items()))
    total = sum(int(row["bodies"]) for row in rows)
    content = slowest["slowest"][:400]
    print(f"{path}: {total} bodies: {told}; slowest {seconds:.2f} s: {content}", flush=True)
    return seconds < LIMIT_S
