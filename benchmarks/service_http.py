"""A batch of estimates against a real server, and how long health checks wait meanwhile.

    python -m benchmarks.service_http --frames 1000000

Baseline: the same health checks against the idle server, in the same run.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor

import httpx
import numpy as np

from benchmarks.service_estimates import body

JSON = {"Content-Type": "application/json"}


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000)
    n = parser.parse_args().frames
    start = time.perf_counter()
    command = (sys.executable, "-m", "service.cli", "serve", "--port", "0")
    limits = {"HYBRIDTOF_MAX_BODY_BYTES": str(2**28), "HYBRIDTOF_MAX_HELD_BYTES": str(2**30)}
    limits |= {"HYBRIDTOF_REQUEST_S": "600"}
    server = subprocess.Popen(  # noqa: S603
        command, stderr=subprocess.PIPE, text=True, env=os.environ | limits
    )
    assert server.stderr is not None
    try:
        match = None
        while match is None:
            match = re.search(r"running on (http://\S+)", server.stderr.readline())
        address = match[1]
        httpx.get(address + "/health/live").raise_for_status()
        print(f"first health answer after {time.perf_counter() - start:.1f} s")
        first = httpx.post(address + "/v1/estimates", content=body(10), headers=JSON, timeout=600)
        first.raise_for_status()
        content = body(n)
        show("idle", waits(address, None, 100))
        with ThreadPoolExecutor(1) as threads:
            start = time.perf_counter()
            batch = threads.submit(
                httpx.post, address + "/v1/estimates", content=content, headers=JSON, timeout=600
            )
            show("during the batch", waits(address, batch, 0))
        response = batch.result()
        seconds = time.perf_counter() - start
        size = len(response.content) / 2**20
        print(f"{n} frames: {response.status_code}, {size:.0f} MiB in {seconds:.2f} s")
        start = time.perf_counter()
    finally:
        server.terminate()
        server.wait()
        print(f"ended {time.perf_counter() - start:.1f} s after SIGTERM")


if __name__ == "__main__":
    main()
