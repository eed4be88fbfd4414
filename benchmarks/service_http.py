"""The service under load, beside an empty FastAPI endpoint in the same run.

    python -m benchmarks.service_http [--against CHECKOUT] [--frames 1000000]

First, estimates of one frame from 1, 8 and 64 clients that ask as fast as they are answered, and
batches of 1,000 frames from 8; the servers take turns, round by round. Baselines: an endpoint that
returns an empty object and reads nothing, on the same server, and another checkout of this
repository. Then, with ``--frames``, one large batch, and how long health checks wait meanwhile;
baseline: the same checks against the idle server.
"""

import argparse
import contextlib
import json
import tempfile
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np

from benchmarks.http_load import asked, post, served
from benchmarks.service_estimates import body

JSON = {"Content-Type": "application/json"}
ROUTE = "/v1/estimates"
FRAMES = 1000


def one_frame() -> bytes:
    sensor = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}}
    scene = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}}
    frames = {"w1": [0.01], "w2": [1.5]}
    return json.dumps({"sensor": sensor, "scene": scene, "frames": frames}).encode()


def p99_ms(times: list[float]) -> float:
    return float(np.quantile(times, 0.99)) * 1e3


def load(servers: dict[str, str], rounds: int, count: int) -> None:
    """Print what requests of one frame take, and how many frames of batches are answered."""
    for clients in (1, 8, 64):
        times: dict[str, list[float]] = {name: [] for name in servers}
        for _ in range(rounds):
            for name, address in servers.items():
                times[name] += asked(address, post(address, ROUTE, one_frame()), clients, count)[0]
        base = p99_ms(times["empty"])
        for name, found in times.items():
            p50, p99 = np.median(found) * 1e3, p99_ms(found)
            ratio = f"{p99 / base:.2f} times the empty endpoint"
            print(f"{clients:3d} clients, {name:<17} p50 {p50:7.2f} ms, p99 {p99:7.2f} ms, {ratio}")
    batches = {
        "rows": (ROUTE, set(servers) - {"empty"}),
        "columns": (ROUTE + "?shape=columns", {"service"}),
    }
    for shape, (path, names) in batches.items():
        for name in sorted(names):
            address = servers[name]
            request = post(address, path, body(FRAMES))
            taken = [asked(address, request, 8, count // 4)[1] for _ in range(rounds)]
            rate = FRAMES * (count // 4) / min(taken)
            print(f"batches of {FRAMES}, {name:<10} {shape:<8} {rate:9.0f} frames/s")


def waits(address: str, until: "Future[httpx.Response] | None", count: int) -> list[float]:
    """Time health checks, ``count`` of them or until a request is answered."""
    found: list[float] = []
    with httpx.Client() as client:
        while len(found) < count if until is None else not until.done():
            start = time.perf_counter()
            client.get(address + "/health/live", timeout=60).raise_for_status()
            found.append(time.perf_counter() - start)
            time.sleep(0.01)
    return found


def show(what: str, seconds: list[float]) -> None:
    median, most = np.median(seconds) * 1e3, max(seconds) * 1e3
    print(f"health check, {what:<18} median {median:7.1f} ms, worst {most:7.1f} ms")


def large(address: str, n: int, path: str) -> None:
    content = body(n)
    show("idle", waits(address, None, 100))
    with ThreadPoolExecutor(1) as threads:
        start = time.perf_counter()
        batch = threads.submit(
            httpx.post, address + path, content=content, headers=JSON, timeout=600
        )
        show("during the batch", waits(address, batch, 0))
    response = batch.result()
    seconds = time.perf_counter() - start
    sizes = f"{len(content) / 2**20:.0f} MiB, answered {len(response.content) / 2**20:.0f} MiB"
    print(f"{n} frames to {path}: {response.status_code}, {sizes} in {seconds:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout of this repository")
    parser.add_argument("--frames", type=int, default=0, help="of one large batch")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--requests", type=int, default=1000, help="a round")
    args = parser.parse_args()
    serve = ("service.cli", "serve", "--port", "0")
    limits = {"HYBRIDTOF_MAX_BODY_BYTES": str(2**28), "HYBRIDTOF_MAX_HELD_BYTES": str(2**30)}
    limits |= {"HYBRIDTOF_REQUEST_S": "600", "HYBRIDTOF_WARM": "off"}
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:

        def kept(name: str) -> dict[str, str]:
            return limits | {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/{name}.sqlite"}

        servers = {
            "empty": stack.enter_context(served("benchmarks.empty_service")),
            "service": stack.enter_context(served(*serve, settings=kept("this"))),
        }
        if args.against is not None:
            servers["other checkout"] = stack.enter_context(
                served(*serve, tree=args.against, settings=kept("other"))
            )
        for name, address in servers.items():
            if name != "empty":  # machine code is loaded, or made
                for content in (one_frame(), body(FRAMES)):
                    asked(address, post(address, ROUTE, content), 8, 300)
        load(servers, args.rounds, args.requests)
        if args.frames:
            for path in (ROUTE, ROUTE + "?shape=columns"):
                large(servers["service"], args.frames, path)


if __name__ == "__main__":
    main()
