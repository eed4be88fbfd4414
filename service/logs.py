"""Logs on standard error: one JSON object a line, or for a terminal one line of text."""

import atexit
import collections
import contextlib
import logging
import os
import sys
import threading
import time
from datetime import UTC, datetime
from typing import Any

import orjson

from service.border.traces import REQUEST_ID

__all__ = ["JsonLines", "Lines", "PlainLines", "log_config"]

_MOST_LINES = 2000
_FLUSH_S, _MOMENT_S = 0.5, 0.02


def _members(record: logging.LogRecord) -> dict[str, Any]:
    """Return what a line has besides its message."""
    found: dict[str, Any] = {}
    if (request := REQUEST_ID.get()) is not None:
        found["request_id"] = request
    return found | getattr(record, "fields", {})


class JsonLines(logging.Formatter):
    """One JSON object a line, tracebacks included."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        line |= _members(record)
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return orjson.dumps(line, default=str).decode()


class PlainLines(logging.Formatter):
    """For people: level, message, and what else there is."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, and a traceback below it."""
        rest = " ".join(f"{name}={value}" for name, value in _members(record).items())
        text = f"{record.levelname.lower()}: {record.getMessage()} {rest}".rstrip()
        return f"{text}\n{self.formatException(record.exc_info)}" if record.exc_info else text


class Lines(logging.Handler):
    """Writes lines in a thread of its own, and drops them where nobody reads for long.

    A pipe that is full would otherwise halt the service with its next line. Lines are written a
    moment later, together: a thread that wakes at each of them takes turns from those that answer.
    """

    def __init__(self) -> None:
        super().__init__()
        self._lines: collections.deque[bytes] = collections.deque()
        self._more = threading.Event()
        self._writing = False
        threading.Thread(target=self._write, name="log", daemon=True).start()
        atexit.register(self.flush)

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line over."""
        if len(self._lines) < _MOST_LINES:
            self._lines.append((self.format(record) + "\n").encode("utf-8", "replace"))
            if not self._more.is_set():
                self._more.set()

    def flush(self) -> None:
        """Wait until what was said is written, but not for a reader that stands still."""
        end = time.monotonic() + _FLUSH_S
        while (self._lines or self._writing) and time.monotonic() < end:
            time.sleep(0.005)

    def _write(self) -> None:
        while True:
            self._more.wait()
            time.sleep(_MOMENT_S)
            self._more.clear()  # who says something from here on sets it again
            self._writing = True
            rest = b"".join([self._lines.popleft() for _ in range(len(self._lines))])
            with contextlib.suppress(OSError):  # nobody reads any more
                while rest:
                    # not sys.stderr, whose lock a thread that is stuck would keep to the end
                    rest = rest[os.write(2, rest) :]
            self._writing = False


class NoSockets(logging.Filter):
    """Drops uvicorn's lines of WebSockets, which have one of their own like every request."""

    def filter(self, record: logging.LogRecord) -> bool:
        """See `logging.Filter`."""
        said = str(record.msg)
        return not ('"WebSocket' in said or said.startswith("connection "))


def log_config(level: str) -> dict[str, Any]:
    """Return a configuration for `logging.config.dictConfig`.

    Parameters
    ----------
    level : str
        From which on lines are written.
    """
    # of which no line tells, and which are asked at every line
    logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False
    form = PlainLines if sys.stderr.isatty() else JsonLines
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {"lines": {"()": form}},
        "filters": {"sockets": {"()": NoSockets}},
        "handlers": {"stderr": {"()": Lines, "formatter": "lines", "filters": ["sockets"]}},
        "loggers": {
            name: {"handlers": ["stderr"], "level": level.upper(), "propagate": False}
            for name in ("hybridtof", "uvicorn")
        }
        # of a cluster, which says what it does by loggers of its own
        | {
            name: {"handlers": ["stderr"], "level": "WARNING", "propagate": False}
            for name in ("distributed", "distributed.client")
        },
    }
