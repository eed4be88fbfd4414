"""Where lines wait for their turn: a room that has an end, whoever sends and whoever does not read.

A line is stale when it has waited `STALE_S` for its turn and a newer one is there: a client that
does not read its answers, or lines that come faster than they are answered.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable
from operator import attrgetter

from service.streams.lines import Line, arriving

__all__ = ["STALE_S", "Room"]

STALE_S = 0.2
_LINES = 1000
_BYTES = 2**18
_RAW: Callable[[Line], bytes | None] = attrgetter("raw")


class Room:
    """Holds the lines of one client.

    Parameters
    ----------
    latest : bool
        Whether old lines make room for new ones; else new ones wait outside.
    """

    def __init__(self, latest: bool) -> None:
        self._latest = latest
        self._lines: deque[Line] = deque()
        self._bytes = 0
        self._dropped = 0
        self._ended = False
        self._news, self._space = asyncio.Event(), asyncio.Event()

    def _full(self) -> bool:
        return len(self._lines) >= _LINES or self._bytes >= _BYTES

    def _pop(self) -> Line:
        line = self._lines.popleft()
        self._bytes -= len(line.raw or b"")
        return line

    async def put(self, raws: Iterable[bytes | None]) -> None:
        """Let lines in, in their order; return when all are."""
        lines = arriving(raws, time.perf_counter())
        while lines:
            while self._full():
                if self._latest:
                    self._pop()
                    self._dropped += 1
                else:
                    self._space.clear()
                    await self._space.wait()
            some = lines[: _LINES - len(self._lines)]
            del lines[: len(some)]
            self._lines += some
            self._bytes += sum(map(len, filter(None, map(_RAW, some))))
            self._news.set()

    def end(self) -> None:
        """Say that no more lines come."""
        self._ended = True
        self._news.set()

    async def take(self) -> list[Line]:
        """Return all lines as soon as there are any, without stale ones; none at the end."""
        while not self._lines and not self._ended:
            self._news.clear()
            await self._news.wait()
        now = time.perf_counter()
        while self._latest and len(self._lines) > 1 and now - self._lines[0].arrived > STALE_S:
            self._pop()
            self._dropped += 1
        lines = list(self._lines)
        self._lines.clear()
        self._bytes = 0
        self._space.set()
        if lines and self._dropped:
            lines[0] = lines[0]._replace(dropped=self._dropped)
            self._dropped = 0
        return lines
