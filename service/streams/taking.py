"""Lines of a stream in, answers out: the one function behind HTTP, WebSocket and command line.

However the lines are cut into batches, the answers are the same to the last bit, but for
``latency_s``.
"""

import dataclasses
import time
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.self_calibration.following import Piece
from service.errors import BodyTooLargeError
from service.streams.answered import encoded, error_of, more_of, text_of
from service.streams.cutting import LONGEST
from service.streams.digests import Digests, digests_of, with_digests
from service.streams.followers import Follower
from service.streams.forms import Form
from service.streams.lines import COUNTS, Before, Earlier, Line, Place, Taken, ended, lines_in
from service.streams.numbering import answered_before, missing_before, number_in
from service.streams.said import Said, said_of, said_to_bytes
from service.streams.shapes import (
    Shape,
    frames_of,
    of_one_frame,
    one_frame,
    passes,
    shape_of,
    tells,
)
from service.streams.supposing import More, Supposing, told_with
from service.streams.together import together
from simulator.errors import HybridTofError, InvalidInputError
from simulator.frames import Frames

__all__ = ["take"]

_SET_BACK_S = 1.0  # by more than that no line comes late

# a frame that waits for the tracker, together with others of its shape: where its answer goes, its
# number, time and arrival, its values, and what else is to be said
_Waiting = tuple[int, int, float, float, tuple[Any, ...], dict[str, Any] | None]

_ARRIVED: Callable[[Line], float] = attrgetter("arrived")


def take(
    follower: Follower, place: Place, lines: Sequence[Line], form: Form, earlier: Earlier
) -> Taken:
    """Answer lines in their order.

    Parameters
    ----------
    follower : Follower
        Which answers frames.
    lines : sequence of Line
        What came.
    form : Form
        How to read them.
    earlier : Earlier
        What is answered to numbers that came before.
    """
    try:
        return _Batch(follower, place, form, earlier, alone=False).take(lines)
    except _UnsoundError:
        return _Batch(follower, place, form, earlier, alone=True).take(lines)


class _UnsoundError(Exception):
    """One of several frames has a value that only a closer look at each tells."""


class _Batch:
    """One call of `take`."""

    def __init__(
        self, follower: Follower, place: Place, form: Form, earlier: Earlier, alone: bool
    ) -> None:
        self._follower, self._form, self._earlier, self._alone = follower, form, earlier, alone
        self._model = follower.base
        self._place = place
        self._state = place.state
        self._sequence = place.sequence
        self._time = follower.time_of(place.state)
        self._unnumbered = place.unnumbered
        self._counts = dict.fromkeys(COUNTS, 0)
        self._surprise, self._misfit = place.surprise, place.misfit
        self._told = Supposing(place.supposed, place.early)
        self._answers: list[bytes] = []
        self._at: dict[int, int] = {}
        self._digests: dict[int, int] = {}
        self._repeats: list[tuple[int, int, int, int]] = []
        self._waiting: list[_Waiting] = []
        self._names: tuple[str, ...] | None = None
        self._shape: Shape | None = None

    def take(self, lines: Sequence[Line]) -> Taken:
        found = self._alike(lines)
        if found is not None:
            text, kept, digests = found
            kept = with_digests(kept, digests)
            return self._taken(text, text[text.rfind(b"\n", 0, -1) + 1 : -1], kept)
        for line in lines:
            self._take(line)
        self._track()
        new = [self._answers[at] for at in self._at.values()]
        for at, *repeated in self._repeats:
            self._answers[at] = self._said_before(*repeated)
        last_new = new[-1] if new else self._place.last
        kept = with_digests(ended(new), list(self._digests.values()))
        return self._taken(ended(self._answers), last_new, kept)

    def _taken(self, text: bytes, last: bytes, kept: bytes) -> Taken:
        """Return what has become of the lines."""
        place = dataclasses.replace(
            self._place,
            state=self._state,
            sequence=self._sequence,
            unnumbered=self._unnumbered,
            surprise=self._surprise,
            misfit=self._misfit,
            last=last,
            calibration=self._follower.told(self._state),
            **self._told._asdict(),
            **{name: getattr(self._place, name) + n for name, n in self._counts.items()},
        )
        return Taken(place, text, kept, len(self._repeats), any(self._counts.values()))

    def _alike(self, lines: Sequence[Line]) -> tuple[bytes, bytes, Digests] | None:
        """Return the answers to lines that are good and alike, what is kept, and their digests."""
        if self._alone or not lines:
            return None
        after = max(self._sequence, 0) + 1 + self._unnumbered + lines[0].dropped
        found = together(self._model, self._form, lines, (self._sequence, after, self._time))
        if found is None:
            return None
        try:
            state, pieces = self._follower.follow(self._state, found.frames, found.sequences)
        except InvalidInputError:
            return None
        also = found.passed
        told = missing_before(found.sequences[0] - after if self._sequence >= 0 else 0, lines[0])
        if told:
            also = also or [None] * len(lines)
            also[0] = told | (also[0] or {})
        self._counts["gaps"] += told.get("gap", 0)
        self._counts["dropped"] += told.get("dropped", 0)
        self._sequence, self._unnumbered = found.sequences[-1], 0
        self._time = float(found.times[-1])
        self._state = state
        arrivals = list(map(_ARRIVED, lines))
        more = self._supposing(found.frames, also)
        said = self._say(pieces, found.sequences, found.times, arrivals, more)
        text = b"".join(map(text_of, said))
        return text, said_to_bytes(said[0]) if len(said) == 1 else text, found.digests

    def _take(self, line: Line) -> None:
        """Answer a line, or let it wait for the tracker."""
        at = len(self._answers)
        self._answers.append(b"")
        after = max(self._sequence, 0) + 1 + self._unnumbered + line.dropped
        self._counts["dropped"] += line.dropped
        frame: dict[str, Any] = {}
        try:
            if line.raw is None:
                raise BodyTooLargeError(f"the line has more than {LONGEST} bytes")
            frame = self._form.frame_in(line.raw)
            sequence = number_in(frame, after)
        except HybridTofError as error:
            # the number is free still: a line that states it may follow
            self._unnumbered += line.dropped + 1
            self._refuse(at, after, error, missing_before(0, line), frame)
            return
        names = list(filter(tells, frame))
        (digest,) = digests_of(names, lambda name: [frame[name]], 1).tolist()
        if sequence <= self._sequence:
            self._repeats.append((at, sequence, self._sequence, digest))
            return
        also = missing_before(sequence - after if self._sequence >= 0 else 0, line)
        self._counts["gaps"] += also.get("gap", 0)
        self._sequence, self._unnumbered = sequence, 0
        self._at[sequence], self._digests[sequence] = at, digest
        try:
            self._wait(at, sequence, also, line, frame)
        except HybridTofError as error:
            self._refuse(at, sequence, error, also, frame)

    def _refuse(
        self,
        at: int,
        sequence: int,
        error: HybridTofError,
        also: dict[str, Any],
        frame: dict[str, Any],
    ) -> None:
        """Answer a line by an error."""
        self._counts["errors"] += 1
        said = {"sequence": sequence, "error": error_of(error), **also}
        self._answers[at] = encoded(said | {n: frame[n] for n in frame if passes(n)})

    def _wait(
        self, at: int, sequence: int, also: dict[str, Any], line: Line, frame: dict[str, Any]
    ) -> None:
        """Let a frame wait for the tracker, where nothing is wrong with it."""
        names = tuple(frame)
        known = self._shape if names == self._names else None
        shape = known or shape_of(self._model, names)
        if shape.problem is not None:
            raise shape.problem
        values = shape.values(frame)
        alone = None
        if not shape.sound(values):
            alone = one_frame(self._model, frame, shape.columns)
        time_s = float(frame["time_s"])
        if time_s <= self._time:
            message = f"{time_s:.15g} s is not later than the last frame, {self._time:.15g} s"
            if self._time - time_s > _SET_BACK_S:
                message += "; where a clock was set back, or that frame's was wrong: a new stream"
            raise InvalidInputError.at("/time_s", message)
        if self._alone and alone is None:
            alone = one_frame(self._model, frame, shape.columns)
        if shape is not self._shape or alone is not None:
            self._track()
        self._names, self._shape = names, shape
        self._time = time_s
        for name in shape.passed:
            also[name] = frame[name]
        self._waiting.append((at, sequence, time_s, line.arrived, values, also or None))
        if alone is not None:
            self._track(alone)

    def _track(self, frames: Frames | None = None) -> None:
        """Let the tracker see what waits, and answer it."""
        waiting, self._waiting = self._waiting, []
        if not waiting or self._shape is None:
            return
        at, sequences, times, arrivals, values, also = zip(*waiting, strict=True)
        try:
            if frames is None:
                frames = frames_of(self._model, self._shape, tuple(zip(*values, strict=True)))
            self._state, pieces = self._follower.follow(self._state, frames, sequences)
        except InvalidInputError as error:
            if not self._alone:
                raise _UnsoundError from None
            self._time = self._follower.time_of(self._state)
            raise of_one_frame(error) from None
        some = self._supposing(frames, also if any(also) else None)
        said = self._say(pieces, sequences, times, arrivals, some)
        for place, answer in zip(at, lines_in(b"".join(map(text_of, said))), strict=True):
            self._answers[place] = answer

    def _supposing(self, frames: Frames, also: More) -> More:
        """Return what is said of frames, with what is told once a stream."""
        self._told, more = told_with(self._told, self._model.sensor, frames, also)
        return more

    def _say(
        self,
        pieces: Sequence[Piece],
        sequences: Sequence[int],
        times: Sequence[float] | NDArray[np.float64],
        arrivals: Sequence[float],
        also: More,
    ) -> list[Said]:
        """Return what follows the stream says of frames, piece by piece."""
        latencies, start, said = time.perf_counter() - np.array(arrivals), 0, []
        for track, event in pieces:
            part = slice(start, start + len(track))
            more = None if also is None else also[part]
            if event is not None:
                first, *others = more or [None] * len(track)
                more = [{**(first or {}), "calibration": event}, *others]
            said.append(
                said_of(track, sequences[part], times[part], latencies[part], more_of(more))
            )
            start += len(track)
        self._counts["answered"] += len(sequences)
        surprise = float(track.surprise[-1])
        self._surprise = surprise if np.isfinite(surprise) else None
        self._misfit = bool(track.misfit[-1])
        return said

    def _said_before(self, sequence: int, last: int, digest: int) -> bytes:
        """Return what was answered to a number, or why the line has no answer."""
        at = self._at.get(sequence)
        own = None if at is None else Before(self._answers[at], self._digests[sequence])
        try:
            return answered_before(own or self._earlier, sequence, last, digest)
        except HybridTofError as error:
            return encoded({"sequence": sequence, "error": error_of(error)})
