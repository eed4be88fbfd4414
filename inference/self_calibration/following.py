"""Frames in, answers and changes of the scene out: the step of a stream that calibrates itself.

::

    state = begin(plan)
    state, pieces = follow(plan, state, frames, sequence)
    if state.asked is not None:
        state = conclude(state, answer(plan.sensor, state.asked), applies_at)

A pure fold: however a stream is cut, the same frames, seed and numbers ``applies_at`` give the
same answers to the last bit.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from inference.self_calibration.ageing import awake, old_from
from inference.self_calibration.calibration import Asked, Outcome
from inference.self_calibration.gathering import EMPTY, Kept, in_order, kinds_of, surprising
from inference.self_calibration.handing_over import hand_over
from inference.self_calibration.looking import EVERY, look
from inference.self_calibration.plan import Plan
from inference.self_calibration.state import CalibrationState, Switch
from inference.self_calibration.withholding import faded, not_free, withheld
from inference.tracking.track import Track, step
from simulator.frames import Frames

__all__ = ["Conclude", "Piece", "conclude", "follow", "wanted"]

_RECENT = 300  # frames: those that a new tracker begins with, and those since the last look

Conclude = Callable[[CalibrationState], CalibrationState]


class Piece(NamedTuple):
    """Frames one after another that one tracker answered.

    Attributes
    ----------
    track : Track
        Its answers.
    event : dict or None
        What changed at the first of them.
    """

    track: Track
    event: dict[str, Any] | None


def follow(
    plan: Plan,
    state: CalibrationState,
    frames: Frames,
    sequence: Sequence[int],
    concluding: Conclude | None = None,
) -> tuple[CalibrationState, list[Piece]]:
    """Take in frames.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream.
    frames : Frames
        One or more.
    sequence : sequence of int
        Number of each, increasing.
    concluding : callable, optional
        Is given the state as soon as a calibration is asked for, and may conclude it at once.

    Returns
    -------
    (CalibrationState, list of Piece)

    Raises
    ------
    InvalidInputError
        As `inference.tracking.track.step`, and where a temperature that plays a part is not known;
        the state is what it was.
    """
    frames = plan.at_reference(frames)
    numbers = np.asarray(sequence, dtype=np.int64)
    pieces, start = [], 0
    while start < len(frames):
        event = None
        if state.switch is not None and numbers[start] >= state.switch.applies_at:
            one = frames.select(slice(start, start + 1))
            state, event = hand_over(plan, state, one, int(numbers[start]))
        state = awake(plan, state, _time_of(frames, start))
        end = min(len(frames), start + EVERY - state.count % EVERY)
        end = min(end, _outlived(state, frames, start))
        if state.switch is not None:
            end = min(end, int(np.searchsorted(numbers, state.switch.applies_at)))
        part = frames.select(slice(start, end))
        state, track = _tracked(plan, state, part, numbers[start:end])
        pieces.append(Piece(track, event))
        if state.count % EVERY == 0:
            was = state.asked
            state = look(plan, state, int(numbers[end - 1]))
            if state.asked is not None and state.asked is not was and concluding is not None:
                state = concluding(state)
        start = end
    return state, pieces


def _time_of(frames: Frames, index: int) -> float:
    return 0.0 if frames.time_s is None else float(frames.time_s[index])


def _outlived(state: CalibrationState, frames: Frames, start: int) -> int:
    """Return the first frame behind the next one for which the scene in force is too old."""
    if frames.time_s is None:
        return len(frames)
    late = np.searchsorted(frames.time_s[start + 1 :], old_from(state), side="right")
    return start + 1 + int(late)


def _tracked(
    plan: Plan, state: CalibrationState, frames: Frames, numbers: Any
) -> tuple[CalibrationState, Track]:
    """Track frames between two looks."""
    model = plan.tracker(state.scene)
    after, track = step(model, state.track, frames)
    if state.calibrated:
        track = withheld(model, frames, track)
        widest, widest_at = 0.0, 0.0
    else:
        track = not_free(model, frames, _told_empty(state), track)
        track, widest, widest_at = faded(frames, track, state.widest, state.widest_at)
    kinds = kinds_of(plan.sensor, frames, track, state.trusts_empty)
    recent = in_order(state.recent, Kept(frames, numbers, kinds)).select(slice(-_RECENT, None))
    changed = dataclasses.replace(
        state,
        track=after,
        recent=recent,
        count=state.count + len(frames),
        surprises=state.surprises + int(surprising(track).sum()),
        widest=widest,
        widest_at=widest_at,
    )
    return changed, track


def _told_empty(state: CalibrationState) -> Frames | None:
    """Return the last frames without the object that tell of the scene as it is now."""
    recent = state.recent.select(slice(-max(state.count - state.since, 1), None))
    return recent.select(recent.kind == EMPTY).frames


def conclude(state: CalibrationState, outcome: Outcome, applies_at: int) -> CalibrationState:
    """Take in what became of the calibration that was asked for.

    Parameters
    ----------
    state : CalibrationState
        With `asked`.
    outcome : Outcome
        Of it.
    applies_at : int
        Number of the first frame, of those to come, that may be answered by it.
    """
    return dataclasses.replace(state, switch=Switch(applies_at, outcome, ""))


def wanted(state: CalibrationState) -> Asked | None:
    """Return the calibration that is asked for and not concluded."""
    return state.asked if state.switch is None else None
