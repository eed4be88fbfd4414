"""What follows a stream: a tracker of one scene, or one whose scene is calibrated on the way."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Protocol

from inference.self_calibration.following import Conclude, Piece, follow
from inference.self_calibration.plan import Plan, begin
from inference.self_calibration.state import (
    CalibrationState,
    calibration_from_bytes,
    calibration_to_bytes,
)
from inference.tracking.hypotheses import TIME
from inference.tracking.state import TrackState, check_state, state_from_bytes, state_to_bytes
from inference.tracking.track import step
from inference.tracking.tracker import Tracker
from simulator.errors import InvalidInputError
from simulator.frames import Frames

__all__ = ["Calibrating", "Follower", "Plain"]


class Follower(Protocol):
    """Answers frames of one stream, from one state to the next."""

    @property
    def base(self) -> Tracker:
        """A tracker that takes the frames of this stream."""
        ...

    @property
    def first(self) -> Any:
        """The state before any frame."""
        ...

    def follow(
        self, state: Any, frames: Frames, sequence: Sequence[int]
    ) -> tuple[Any, list[Piece]]:
        """Take in frames; see `inference.self_calibration.following.follow`."""
        ...

    def time_of(self, state: Any) -> float:
        """Return the time of the last frame [s]; nan before the first."""
        ...

    def told(self, state: Any) -> dict[str, Any] | None:
        """Return what clients are told of calibrations, as plain JSON data; None without any."""
        ...

    def to_bytes(self, state: Any) -> bytes:
        """Return a state for a store."""
        ...

    def from_bytes(self, data: bytes) -> Any:
        """Read a state.

        Raises
        ------
        InvalidInputError
            Where it is none of this stream's.
        """
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Plain:
    """A tracker of one scene."""

    base: Tracker

    @property
    def first(self) -> TrackState:
        """See `Follower`."""
        return self.base.first

    def follow(
        self,
        state: TrackState,
        frames: Frames,
        sequence: Sequence[int],  # noqa: ARG002
    ) -> tuple[TrackState, list[Piece]]:
        """See `Follower`."""
        state, track = step(self.base, state, frames)
        return state, [Piece(track, None)]

    def time_of(self, state: TrackState) -> float:
        """See `Follower`."""
        return float(state.hypotheses.numbers[TIME])

    def told(self, state: TrackState) -> None:
        """See `Follower`."""

    def to_bytes(self, state: TrackState) -> bytes:
        """See `Follower`."""
        return state_to_bytes(state)

    def from_bytes(self, data: bytes) -> TrackState:
        """See `Follower`."""
        return _of(self.base, state_from_bytes(data))


@dataclasses.dataclass(frozen=True, eq=False)
class Calibrating:
    """A tracker whose scene is calibrated on the way.

    Attributes
    ----------
    base : Tracker
        Of the scene as it was stated.
    concluding : callable, optional
        See `inference.self_calibration.following.follow`.
    """

    plan: Plan
    base: Tracker
    concluding: Conclude | None = None

    @classmethod
    def of(cls, plan: Plan, concluding: Conclude | None = None) -> "Calibrating":
        """Make one of a plan."""
        return cls(plan, plan.reader(), concluding)

    @property
    def first(self) -> CalibrationState:
        """See `Follower`."""
        return begin(self.plan)

    def follow(
        self, state: CalibrationState, frames: Frames, sequence: Sequence[int]
    ) -> tuple[CalibrationState, list[Piece]]:
        """See `Follower`."""
        return follow(self.plan, state, frames, sequence, self.concluding)

    def time_of(self, state: CalibrationState) -> float:
        """See `Follower`."""
        recent = state.recent.frames
        if recent is None or recent.time_s is None:
            return float("nan")
        return float(recent.time_s[-1])

    def told(self, state: CalibrationState) -> dict[str, Any]:
        """See `Follower`."""
        asked = None
        if (of := state.asked) is not None:
            asked = {"number": of.number, "seed": of.seed, "reason": of.reason,
                     "decided_at": of.decided_at}  # fmt: skip
        return {
            "seed": self.plan.seed,
            "known": state.known,
            "gathered": len(state.gathered),
            "asked": asked,
            "events": list(state.events),
        }

    def to_bytes(self, state: CalibrationState) -> bytes:
        """See `Follower`."""
        return calibration_to_bytes(state)

    def from_bytes(self, data: bytes) -> CalibrationState:
        """See `Follower`."""
        state = calibration_from_bytes(data)
        _of(self.plan.tracker(state.scene), state.track)
        return state


def _of(model: Tracker, state: TrackState) -> TrackState:
    """Return a state that is of a tracker."""
    check_state(state, model.first)
    if state.signature != model.first.signature:
        raise InvalidInputError.at("/state", "belongs to another tracker")
    return state
