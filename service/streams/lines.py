"""Lines of a stream, where it stands, and what was answered."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from itertools import repeat
from typing import Any, NamedTuple, Protocol

from inference.self_calibration.state import CalibrationState
from inference.tracking.state import TrackState

__all__ = [
    "COUNTS",
    "LARGEST",
    "WINDOW",
    "Before",
    "Earlier",
    "Line",
    "Place",
    "Taken",
    "arriving",
    "ended",
    "lines_in",
]

WINDOW = 4096
"""Numbers behind the last one whose answers are kept."""

LARGEST = 2**53 - 1
"""Of numbers, so that readers of JSON that know only floats do not round them."""

COUNTS = ("answered", "errors", "dropped", "gaps")
"""Of lines, by what became of them: members of `Place`."""


class Line(NamedTuple):
    """A line as it arrived.

    Attributes
    ----------
    raw : bytes or None
        None: it was too long.
    arrived : float
        When, by `time.perf_counter`.
    dropped : int
        How many lines before it were dropped unread.
    """

    raw: bytes | None
    arrived: float
    dropped: int = 0


def arriving(raws: Iterable[bytes | None], arrived: float) -> list[Line]:
    """Return lines that arrived together."""
    # as Line(raw, arrived) for each, in a fifth of the time
    return list(map(_new, repeat(Line), zip(raws, repeat(arrived), repeat(0), strict=False)))


_new: Callable[..., Line] = tuple.__new__


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a stream stands.

    Attributes
    ----------
    state : TrackState or CalibrationState
        What follows the stream (`service.streams.followers`).
    sequence : int
        Number of the last line that was answered; -1 before the first.
    answered, errors, dropped, gaps : int
        Frames that were tracked, lines that were answered by an error, lines that were dropped
        unread, numbers that never came.
    unnumbered : int
        How far numbers are counted on over lines since then whose own could not be read.
    surprise : float or None
        The tracker's, after the last frame.
    misfit : bool
        Whether that is more than chance allows.
    last : bytes
        The last answer; empty before the first.
    calibration : dict or None
        What is told of a stream that calibrates itself.
    supposed : bool
        Whether a line was told what its answer supposes.
    early : sequence of sequences of float, or None
        Readings and times of the first frames, until there are enough to look at; then None.
    """

    state: TrackState | CalibrationState
    sequence: int = -1
    answered: int = 0
    errors: int = 0
    dropped: int = 0
    gaps: int = 0
    unnumbered: int = 0
    surprise: float | None = None
    misfit: bool = False
    last: bytes = b""
    calibration: dict[str, Any] | None = None
    supposed: bool = False
    early: Sequence[Sequence[float]] | None = ()


class Before(NamedTuple):
    """What was answered to a number.

    Attributes
    ----------
    answer : bytes
        Without a line end.
    digest : int or None
        Of the line (`service.streams.digests`); None where it was answered before digests were
        kept.
    """

    answer: bytes
    digest: int | None


class Earlier(Protocol):
    """Answers that were given before, to the last `WINDOW` numbers at least."""

    def answer(self, sequence: int) -> Before | None:
        """Return what was answered to a number; None where it has no answer."""
        ...


class Taken(NamedTuple):
    """What has become of some lines.

    Attributes
    ----------
    place : Place
        Where the stream stands after them.
    text : bytes
        The answers, one a line, each with its end.
    kept : bytes
        Those that were not given before, as `service.streams.answered.before_in` reads them.
    repeated : int
        How many lines had come before.
    changed : bool
        Whether the stream stands elsewhere after them.
    """

    place: Place
    text: bytes
    kept: bytes
    repeated: int
    changed: bool

    @property
    def answers(self) -> list[bytes]:
        """One a line, without its end."""
        return lines_in(self.text)


def ended(lines: Sequence[bytes]) -> bytes:
    """Return lines as one text, with their ends."""
    return b"".join(line + b"\n" for line in lines)


def lines_in(text: bytes) -> list[bytes]:
    """Return the lines of a text, each of which has an end."""
    return text.split(b"\n")[:-1]
