"""A stream as lines: one frame a line in, one answer a line out (docs/streams.md)."""

import csv
import json
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from inference.estimates import Status
from inference.tracking.state import TrackState
from inference.tracking.track import Track, step
from inference.tracking.tracker import Tracker
from service.column_names import NAMES, check_names, ignored_names
from service.errors import MalformedError
from service.frame_files import check_separator
from service.frame_table import value_of_text
from service.problems import describe
from service.strict_json import decode
from simulator.errors import HybridTofError, InvalidInputError
from simulator.frames import FrameColumns, frames_from_columns
from simulator.validated import parse

__all__ = ["CsvLines", "JsonLines", "TrackedLines", "lines_like"]


class JsonLines:
    """Lines that are JSON objects."""

    def frame_in(self, line: bytes) -> dict[str, Any]:
        """Return the members of a line.

        Raises
        ------
        MalformedError, InvalidInputError
            Where it is no JSON object, or a member's name must be a mistake.
        """
        frame = decode(line)
        if not isinstance(frame, dict):
            raise MalformedError("the line is not a JSON object")
        check_names([name for name in frame if name != "sequence"])
        return frame


class CsvLines:
    """Lines of comma-separated values below a header.

    Parameters
    ----------
    header : bytes
        The line with the names.

    Raises
    ------
    InvalidInputError, MalformedError
        As for files (`service.frame_files`).
    """

    def __init__(self, header: bytes) -> None:
        self._names = [name.strip() for name in _fields(header.removeprefix(b"\xef\xbb\xbf"))]
        check_separator(self._names)
        check_names([name for name in self._names if name != "sequence"])

    def frame_in(self, line: bytes) -> dict[str, Any]:
        """Return the values of a line by the names of its columns.

        Raises
        ------
        MalformedError, InvalidInputError
            For another number of fields, or one that is no number.
        """
        cells = _fields(line)
        if len(cells) != len(self._names):
            message = f"{len(cells)} fields where the header has {len(self._names)}"
            raise MalformedError(message)
        frame: dict[str, Any] = {}
        for name, cell in zip(self._names, cells, strict=True):
            value = value_of_text(name, cell)
            if value is None and name in NAMES:
                raise InvalidInputError.at(f"/{name}", f"is {cell.strip()[:40]!r}")
            if name == "sequence" and isinstance(value, float) and value.is_integer():
                value = int(value)
            frame[name] = cell if value is None else value
        return frame


def _fields(line: bytes) -> list[str]:
    try:
        return next(csv.reader([line.decode("utf-8").rstrip("\r\n")], strict=True), [])
    except (UnicodeDecodeError, csv.Error) as error:
        raise MalformedError(f"the line cannot be read: {error}") from None


def lines_like(first: bytes) -> tuple[JsonLines | CsvLines, bool]:
    """Choose how to read a stream by its first line, and say whether that line is a frame."""
    if first.lstrip().startswith(b"{"):
        return JsonLines(), True
    return CsvLines(first), False


class TrackedLines:
    """A tracker that takes lines.

    Parameters
    ----------
    model : Tracker
        From `inference.tracking.tracker.tracker`.
    lines : JsonLines or CsvLines
        How to read a line.

    Attributes
    ----------
    answered : int
        Frames that were tracked.
    """

    def __init__(self, model: Tracker, lines: JsonLines | CsvLines) -> None:
        self._model = model
        self._lines = lines
        self._state: TrackState = model.first
        self._sequence = 0
        self.answered = 0

    def answer(self, line: bytes) -> str:
        """Take in one frame.

        Parameters
        ----------
        line : bytes
            Of the stream.

        Returns
        -------
        str
            JSON without a line end: the answer, or ``error`` where the line has none; such a line
            changes nothing.
        """
        begin = time.perf_counter()
        self._sequence += 1
        passed: dict[str, Any] = {}
        try:
            frame = self._lines.frame_in(line)
            passed = {name: frame[name] for name in ignored_names(list(frame))}
            if (sequence := passed.pop("sequence", None)) is not None:
                if type(sequence) is not int:
                    raise InvalidInputError.at("/sequence", "must be an integer")
                self._sequence = sequence
            said = self._track({name: frame[name] for name in frame if name in NAMES})
        except HybridTofError as error:
            said = {"error": _error(error)}
        else:
            self.answered += 1
            said["latency_s"] = time.perf_counter() - begin
        # what is passed through never hides what is answered
        return json.dumps({**passed, "sequence": self._sequence, **said}, allow_nan=False)

    def _track(self, frame: Mapping[str, Any]) -> dict[str, Any]:
        try:
            columns = parse(FrameColumns, {name: [value] for name, value in frame.items()})
            frames = frames_from_columns(self._model.sensor, columns)
            state, track = step(self._model, self._state, frames)
        except InvalidInputError as error:
            raise _of_one_frame(error) from None
        self._state = state
        return {"time_s": frame["time_s"]} | answer_of(track, 0)


def answer_of(track: Track, i: int) -> dict[str, Any]:
    """Return what a track says of one frame, null where it says nothing."""
    hypotheses = zip(
        track.hypotheses_m[i], track.hypotheses_sd_m[i], track.hypotheses_weight[i], strict=True
    )
    return {
        "status": Status(int(track.status[i])).name.lower(),
        "range_m": _number(track.range_m[i]),
        "sd_m": _number(track.sd_m[i]),
        "sd_parts_m": {
            name: _number(part[i]) if math.isfinite(track.sd_m[i]) else None
            for name, part in track.sd_parts_m._asdict().items()
        },
        "hypotheses": [
            {"range_m": _number(range_m), "sd_m": _number(sd_m), "weight": _number(weight)}
            for range_m, sd_m, weight in hypotheses
            if math.isfinite(range_m)
        ],
        "present": _number(track.present[i]),
        "outlier": _number(track.outlier[i]),
        "rate_m_s": _number(track.rate_m_s[i]),
        "misfit": bool(track.misfit[i]),
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _of_one_frame(error: InvalidInputError) -> InvalidInputError:
    """Let pointers into columns of one entry point into the line."""
    found = [
        (p.pointer.removeprefix("/frames").removesuffix("/0"), p.message) for p in error.problems
    ]
    pointer, message = found[0]
    return InvalidInputError.at(pointer, message)


def _error(error: HybridTofError) -> dict[str, Any]:
    details = describe(error)
    pointers: Sequence[Mapping[str, str]] = details["errors"]
    return {
        "type": details["type"],
        "title": details["title"],
        "pointer": pointers[0]["pointer"] if pointers else "",
        "detail": details["detail"],
    }
