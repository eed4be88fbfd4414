"""The service under bodies that nobody meant: schemathesis, then bodies that are nearly valid.

    python -m benchmarks.fuzz [--examples 2000] [--bodies 10000]

schemathesis makes requests of the OpenAPI document and holds every answer to it, all checks, for a
service whose posteriors are quick fakes. Nearly valid bodies (tests/service/test_fuzz.py) go to
every route: no 500, nothing that is not finite, nothing beyond 5 s of processor time; of posteriors
everything is computed that comes before the first draw. Ends with exit code 1 where one is.
"""

import argparse
import asyncio
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import hypothesis
from hypothesis import HealthCheck, Phase, given

from benchmarks.http_load import served
from tests.service import test_fuzz, test_schemathesis

LIMIT_S = 5.0
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


def bodies_of(route: str) -> list[dict[str, Any]]:
    """Return good bodies of a route."""
    needed = {"/v1/simulations": "trajectory", "/v1/identifiability": "ranges_m"}
    found = [body for body in test_fuzz.BODIES if needed.get(route, "frames") in body]
    if route == "/v1/posteriors":
        found = [{k: v for k, v in body.items() if k != "techniques"} for body in found]
    return found


def nearly_valid(route: str, count: int) -> bool:
    """Send bodies to a route; whether every answer was as it should be, and in time."""
    statuses: dict[int, int] = {}
    slowest = [(0.0, "")]
    bodies = bodies_of(route)
    with (
        tempfile.TemporaryDirectory() as folder,
        asyncio.Runner() as loop,
        test_fuzz.answering(
            loop, database=f"sqlite:///{folder}/jobs.sqlite", request_s=LIMIT_S
        ) as http,
    ):

        @hypothesis.settings(
            deadline=None,
            database=None,
            max_examples=count,
            phases=(Phase.generate,),
            suppress_health_check=list(HealthCheck),
        )
        @given(
            body=test_fuzz.spoiled(test_fuzz.anything, bodies)
            | test_fuzz.spoiled(test_fuzz.numbers, bodies)
        )
        def send(body: dict[str, Any]) -> None:
            content = json.dumps(body)
            began = time.process_time()
            answer = loop.run(http.post(route, content=content.encode()))
            seconds = time.process_time() - began
            if answer.json().get("type", "").endswith("overdue"):
                seconds = LIMIT_S
            slowest[0] = max(slowest[0], (seconds, content))
            statuses[answer.status_code] = statuses.get(answer.status_code, 0) + 1
            test_fuzz.check(answer)

        send()
    ((seconds, content),) = slowest
    told = ", ".join(f"{n} times {status}" for status, n in sorted(statuses.items()))
    print(f"{route}: {told}; slowest {seconds:.2f} s: {content[:400]}", flush=True)
    return seconds < LIMIT_S


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=2000, help="of schemathesis, a route")
    parser.add_argument("--bodies", type=int, default=10_000, help="nearly valid, a route")
    args = parser.parse_args()
    failed = 0
    if args.examples:
        failed = checked(args.examples, "examples,coverage,fuzzing")
        # ways of several requests each
        failed |= checked(max(args.examples // 20, 1), "stateful")
    good = [nearly_valid(route, args.bodies) for route in test_fuzz.ROUTES if args.bodies]
    return 1 if failed or not all(good) else 0


if __name__ == "__main__":
    sys.exit(main())
