"""What greedy and slow clients cost the others.

    python -m benchmarks.manners [--seconds 10]

First, behind two of each of the heaviest requests that the service accepts: how long a single-frame
estimate, a malformed body and the question whether it is ready wait meanwhile. Then among clients
that send heads without an end, half of large bodies, and never read what they asked for: the same,
and by how much the service's memory grows. Baseline: the same questions to the idle service.
"""

import argparse
import asyncio
import contextlib
import json
import re
import socket
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fleet import SERVE, Service

__all__ = ["Answer", "ask", "crowd", "heaviest", "memory_mb", "probes"]

PULSED = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}}
KNOWN = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}}
HALF = 50 * 2**20
Answer = tuple[int, bytes]


def heaviest() -> dict[str, tuple[str, bytes]]:
    """Return requests that are as large as is accepted: by name, route and body."""
    r = np.linspace(0.1, 5.0, 10_000)
    many = {"w1": (0.01 + 1e-3 / r).tolist(), "w2": (0.02 + 1e-2 / r**2).tolist()}
    unknown = {"prior": "normal", "mean": 0.0, "sd": 0.1}
    wall = {"strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
            "distance_m": {"prior": "uniform", "low": 5.5, "high": 9.0}}  # fmt: skip
    everything = {"crosstalk": [unknown, unknown], "background": wall}
    fit = {"sensor": PULSED, "scene": everything, "frames": many, "techniques": ["joint_fit"]}
    batch = {"w1": [0.01] * 200_000, "w2": [1.5] * 200_000}
    path = {"kind": "radial", "from_m": 0.1, "to_m": 5.0, "frames": 100_000}
    ranges = np.linspace(0.1, 5.0, 10_000).tolist()
    return {
        "fit of 10,000 frames, all unknown": ("/v1/estimates", _json(fit)),
        "batch of 200,000 frames": (
            "/v1/estimates",
            _json({"sensor": PULSED, "scene": KNOWN, "frames": batch}),
        ),
        "simulation of 100,000 frames": (
            "/v1/simulations",
            _json({"sensor": PULSED, "scene": KNOWN, "trajectory": path, "seed": 1}),
        ),
        "identifiability of 10,000 frames": (
            "/v1/identifiability",
            _json({"sensor": PULSED, "scene": everything, "ranges_m": ranges}),
        ),
    }


def probes() -> dict[str, tuple[str, bytes, int]]:
    """Return what others ask meanwhile, and the status that they should get."""
    one = {"sensor": PULSED, "scene": KNOWN, "frames": {"w1": [0.01], "w2": [1.5]}}
    return {
        "single frame": ("/v1/estimates", _json(one), 200),
        "malformed": ("/v1/estimates", b'{"sensor": ', 400),
        "ready": ("/health/ready", b"", 200),
    }


def _json(body: object) -> bytes:
    return json.dumps(body).encode()


def _head(address: str, path: str, length: int) -> bytes:
    method = "POST" if length else "GET"
    lines = [f"{method} {path} HTTP/1.1", f"Host: {address}", "Connection: close"]
    if length:
        lines += ["Content-Type: application/json", f"Content-Length: {length}"]
    return "\r\n".join([*lines, "", ""]).encode()


async def _opened(address: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    host, _, port = address.rpartition(":")
    return await asyncio.open_connection(host, int(port))


async def ask(address: str, path: str, body: bytes) -> Answer:
    """Ask over a connection of its own; return status and all that was said."""
    reader, writer = await _opened(address)
    try:
        writer.write(_head(address, path, len(body)) + body)
        said = await reader.read()
        return int(said.split(None, 2)[1]), said
    finally:
        writer.transport.abort()


def memory_mb(pid: int) -> float:
    """Return the memory of a process [MB]."""
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())
    assert found is not None
    return int(found[1]) / 1024


async def _slow(address: str) -> None:
    """Send a head, a byte now and then, and begin anew where the service hangs up."""
    while True:
        with contextlib.suppress(OSError):
            _, writer = await _opened(address)
            try:
                for byte in b"GET /health/live HTTP/1.1\r\nX: " + b"x" * 1000:
                    writer.write(bytes((byte,)))
                    await writer.drain()
                    await asyncio.sleep(0.5)
            finally:
                writer.transport.abort()
        await asyncio.sleep(0.5)


async def _half(address: str) -> None:
    """Send half of a large body, as much of it as is taken, and then nothing."""
    block = b" " * 2**16
    while True:
        with contextlib.suppress(OSError):
            _, writer = await _opened(address)
            try:
                writer.write(_head(address, "/v1/estimates", 2 * HALF))
                for _ in range(HALF // len(block)):
                    writer.write(block)
                    await writer.drain()
                await asyncio.sleep(3600)
            finally:
                writer.transport.abort()
        await asyncio.sleep(0.5)


async def _deaf(address: str) -> None:
    """Ask for much, and never read it."""
    path, body = heaviest()["simulation of 100,000 frames"]
    host, _, port = address.rpartition(":")
    loop = asyncio.get_running_loop()
    while True:
        with socket.socket() as deaf, contextlib.suppress(OSError):
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.setblocking(False)
            await loop.sock_connect(deaf, (host, int(port)))
            await loop.sock_sendall(deaf, _head(address, path, len(body)) + body)
            await asyncio.sleep(15.0)  # by then the service has given it up


@contextlib.asynccontextmanager
async def crowd(address: str, slow: int, half: int, deaf: int) -> AsyncIterator[None]:
    """Have so many clients of each kind, for as long as this is open."""
    kinds = ((_slow, slow), (_half, half), (_deaf, deaf))
    clients = [asyncio.ensure_future(kind(address)) for kind, n in kinds for _ in range(n)]
    try:
        yield
    finally:
        for client in clients:
            client.cancel()
        await asyncio.gather(*clients, return_exceptions=True)


class _Waits:
    """The longest wait of each probe [s], and the most memory [MB]."""

    def __init__(self, service: Service) -> None:
        self.address, self.pid = service.address.removeprefix("http://"), service.process.pid
        self.waits: dict[str, list[float]] = {name: [] for name in probes()}
        self.wrong: list[str] = []
        self.memory = memory_mb(self.pid)
        self.most = self.memory

    async def once(self) -> None:
        for name, (path, body, status) in probes().items():
            began = time.perf_counter()
            got, said = await ask(self.address, path, body)
            self.waits[name].append(time.perf_counter() - began)
            if got != status:
                self.wrong.append(f"{name}: {got} {said[-200:]!r}")
            self.most = max(self.most, memory_mb(self.pid))

    async def during(self, work: Awaitable[Any]) -> Any:
        working = asyncio.ensure_future(work)
        while not working.done():
            await self.once()
            await asyncio.sleep(0.05)
        return working.result()

    def row(self) -> str:
        longest = "".join(f"{max(waits):12.3f}" for waits in self.waits.values())
        count = len(self.waits["ready"])
        return f"{longest}{count:8d}{len(self.wrong):7d}{self.most - self.memory:10.0f}"


async def _measure(service: Service, seconds: float) -> None:
    address = service.address.removeprefix("http://")
    print(f"{'longest wait [s] of':<36}" + "".join(f"{name:>12}" for name in probes()), end="")
    print(f"{'asked':>8}{'wrong':>7}{'MB more':>10}")
    await _Waits(service).once()  # what is imported by the first
    idle = _Waits(service)
    await idle.during(asyncio.sleep(seconds / 3))
    print(f"{'idle':<36}{idle.row()}")
    for name, (path, body) in heaviest().items():
        waits = _Waits(service)
        began = time.perf_counter()
        two = await waits.during(asyncio.gather(*(ask(address, path, body) for _ in range(2))))
        took = time.perf_counter() - began
        told = ", ".join(str(status) for status, _ in two)
        print(f"{name:<36}{waits.row()}   {took:.1f} s, {told}", *waits.wrong, flush=True)
    waits = _Waits(service)
    async with crowd(address, slow=300, half=8, deaf=4):
        await waits.during(asyncio.sleep(3 * seconds))
    print(f"{'300 slow, 8 half, 4 deaf clients':<36}{waits.row()}", *waits.wrong)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=10.0)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        service = Service(SERVE, {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/jobs.sqlite"})
        try:
            asyncio.run(_measure(service, args.seconds))
        finally:
            service.kill()


if __name__ == "__main__":
    main()
