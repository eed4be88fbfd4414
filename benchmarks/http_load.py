"""Servers, and clients that ask as fast as they are answered, over plain sockets."""

import asyncio
import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import urlsplit

_HEAD = b"\r\n\r\n"
_LENGTH = re.compile(rb"content-length: ([0-9]+)", re.IGNORECASE)


@contextlib.contextmanager
def served(
    *module: str, tree: Path | None = None, settings: Mapping[str, str] | None = None
) -> Iterator[str]:
    """Run a module that serves, of another checkout perhaps; its address."""
    environment = os.environ | (settings or {})
    if tree is not None:
        environment["PYTHONPATH"] = str(tree)
    server = subprocess.Popen(  # noqa: S603
        (sys.executable, "-m", *module),
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env=environment,
        cwd=tree,
    )
    assert server.stderr is not None
    try:
        match = None
        while match is None:
            line = server.stderr.readline()
            assert line, "the server did not start"
            match = re.search(r"running on (http://\S+)", line)
        # its lines are read as somebody reads a log: a pipe that is full would change its work
        log = subprocess.Popen(("cat",), stdin=server.stderr, stdout=subprocess.DEVNULL)  # noqa: S607
        try:
            yield match[1]
        finally:
            server.terminate()
            server.wait()
            log.wait()
    finally:
        server.kill()


def post(address: str, path: str, body: bytes) -> bytes:
    """Return a request as it goes over the wire."""
    lines = (
        f"POST {path} HTTP/1.1",
        f"Host: {urlsplit(address).netloc}",
        "Content-Type: application/json",
        f"Content-Length: {len(body)}",
    )
    return "\r\n".join([*lines, "", ""]).encode() + body


class _Client(asyncio.Protocol):
    """One connection, on which the next request goes out with the end of an answer."""

    def __init__(self, request: bytes, times: list[float], left: list[int]) -> None:
        self._request, self._times, self._left = request, times, left
        self.done = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._ask()

    def _ask(self) -> None:
        if self._left[0] <= 0:
            self._transport.close()
            self.done.set_result(None)
            return
        self._left[0] -= 1
        self._missing: int | None = None
        self._head = b""
        self._begun = time.perf_counter()
        self._transport.write(self._request)

    def data_received(self, data: bytes) -> None:
        if self._missing is None:
            self._head += data
            end = self._head.find(_HEAD)
            if end < 0:
                return
            head = self._head[:end]
            length = _LENGTH.search(head)
            if not head.startswith(b"HTTP/1.1 20") or length is None:
                self.done.set_exception(AssertionError(self._head[:1000].decode()))
                self._transport.abort()
                return
            self._missing = int(length[1]) - (len(self._head) - end - len(_HEAD))
        else:
            self._missing -= len(data)
        if self._missing == 0:
            self._times.append(time.perf_counter() - self._begun)
            self._ask()

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.done.done():
            self.done.set_exception(exc or AssertionError("the server closed a connection"))


def asked(address: str, request: bytes, clients: int, count: int) -> tuple[list[float], float]:
    """Send requests from some clients at once; the time of each, and that of all [s]."""

    async def all_of_them() -> tuple[list[float], float]:
        url, times, left = urlsplit(address), list[float](), [count]
        loop = asyncio.get_running_loop()
        begun = time.perf_counter()
        connections = [
            await loop.create_connection(
                lambda: _Client(request, times, left), url.hostname or "", url.port or 0
            )
            for _ in range(clients)
        ]
        await asyncio.gather(*(client.done for _, client in connections))
        return times, time.perf_counter() - begun

    return asyncio.run(all_of_them())
