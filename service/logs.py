"""Logs on standard error: one JSON object a line, or for a terminal one line of text."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Any

from service.border.traces import REQUEST_ID

__all__ = ["JsonLines", "PlainLines", "log_config"]


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
        return json.dumps(line, default=str)


class PlainLines(logging.Formatter):
    """For people: level, message, and what else there is."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, and a traceback below it."""
        rest = " ".join(f"{name}={value}" for name, value in _members(record).items())
        text = f"{record.levelname.lower()}: {record.getMessage()} {rest}".rstrip()
        return f"{text}\n{self.formatException(record.exc_info)}" if record.exc_info else text


def log_config(level: str) -> dict[str, Any]:
    """Return a configuration for `logging.config.dictConfig`.

    Parameters
    ----------
    level : str
        From which on lines are written.
    """
    form = PlainLines if sys.stderr.isatty() else JsonLines
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {"lines": {"()": form}},
        "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "lines"}},
        "loggers": {
            name: {"handlers": ["stderr"], "level": level.upper(), "propagate": False}
            for name in ("hybridtof", "uvicorn")
        },
    }
