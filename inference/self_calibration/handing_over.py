"""From one scene to the next: told with what was known and said before, and after."""

import dataclasses
import math
from typing import Any

from inference.estimates import Status
from inference.self_calibration.calibration import Outcome
from inference.self_calibration.gathering import surprising
from inference.self_calibration.looking import EVERY
from inference.self_calibration.plan import Plan
from inference.self_calibration.scenes import knowledge, prior_scene, trackable
from inference.self_calibration.state import CalibrationState
from inference.tracking.state import TrackState
from inference.tracking.track import step
from inference.tracking.tracker import Tracker
from simulator.frames import Frames
from simulator.scene import Scene

__all__ = ["hand_over"]

_BEGUN_WITH = 90  # frames that a new tracker has seen when it answers its first
_EVENTS = 8  # that are kept
_AGAIN = 10 * EVERY  # frames before the next calibration, doubled by each that is not taken
_MOST_DOUBLED = 6


def hand_over(
    plan: Plan, state: CalibrationState, frame: Frames, sequence: int
) -> tuple[CalibrationState, dict[str, Any]]:
    """Do what a switch says, before its frame is answered.

    A new tracker sees the last frames once more: it has settled when it is asked.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream, with a switch.
    frame : Frames
        The frame that comes next.
    sequence : int
        Its number.

    Returns
    -------
    (CalibrationState, dict)
        The event is plain JSON data.
    """
    switch = state.switch
    if switch is None:
        raise ValueError("nothing is to change")
    kind, reason = "doubted", switch.reason
    state = _held_against_frames(plan, state)
    switch = state.switch or switch
    scene, changes = _next(plan, state, switch.outcome)
    if switch.outcome is not None:
        kind = "taken" if switch.outcome.scene is not None else "not_taken"
        reason = switch.outcome.reason or (state.asked.reason if state.asked else "")
    event: dict[str, Any] = {"kind": kind, "reason": reason, "sequence": sequence}
    event["applies_at"] = switch.applies_at
    if switch.outcome is not None and state.asked is not None:
        asked = state.asked
        event |= {
            "number": asked.number, "seed": asked.seed, "decided_at": asked.decided_at,
            "from_sequence": asked.sequence[0], "to_sequence": asked.sequence[-1],
            "frames": len(asked.sequence),
            "frames_without_object": int((~asked.frames.present).sum()),
        }  # fmt: skip
        if switch.outcome.scene is None:
            event["misfit"] = switch.outcome.misfit
    event["before"] = _said(plan, state, state.track, frame)
    after = dataclasses.replace(
        state, **changes, switch=None, asked=None if switch.outcome is not None else state.asked
    )
    if scene is not None:
        after = dataclasses.replace(after, scene=scene)
        after = dataclasses.replace(after, track=_settled(plan, after))
    event["after"] = _said(plan, after, after.track, frame)
    return dataclasses.replace(after, events=(*after.events, event)[-_EVENTS:]), event


def _held_against_frames(plan: Plan, state: CalibrationState) -> CalibrationState:
    """Return the state; with an outcome that is not taken where the last frames contradict it."""
    switch, frames = state.switch, state.recent.frames
    if switch is None or switch.outcome is None or frames is None:
        return state
    if (scene := switch.outcome.scene) is None:
        return state
    model = plan.tracker(scene, learnt=True)
    _, track = step(model, model.first, frames)
    if 2 * int(surprising(track).sum()) <= len(track):
        return state
    outcome = Outcome(None, "the last frames contradict it", True, switch.outcome.statuses)
    return dataclasses.replace(state, switch=dataclasses.replace(switch, outcome=outcome))


def _next(
    plan: Plan, state: CalibrationState, outcome: Outcome | None
) -> tuple[Scene | None, dict[str, Any]]:
    """Return the next scene in force, where there is one, and what else changes."""
    unsure = {"calibrated": False, "known": False, "trusts_empty": False, "surprised": 0,
              "surprises": 0}  # fmt: skip
    if outcome is None:
        return trackable(plan.sensor, state.before), unsure
    if outcome.scene is not None:
        of_ranges = outcome.statuses.get("range_m", "identified")
        crosstalk = [s for name, s in outcome.statuses.items() if name.startswith("crosstalk.")]
        # frames without the object tell no range, and may tell all that is unknown
        rest = [s for name, s in outcome.statuses.items() if name != "range_m"]
        known = of_ranges != "not_identified" or all(s == "identified" for s in rest)
        return outcome.scene, {
            "calibrated": True,
            "known": known,
            "trusts_empty": known and all(s == "identified" for s in crosstalk),
            "failures": 0,
            "surprised": 0,
            "surprises": 0,
            "taken_at": state.count,
            "not_before": state.count + _AGAIN,
        }
    failures = state.failures + 1
    wait = _AGAIN * 2 ** min(failures - 1, _MOST_DOUBLED)
    changes = {"failures": failures, "not_before": state.count + wait, "points": 0}
    stated = prior_scene(plan.stated)
    if outcome.misfit and not state.calibrated and state.before != stated:
        # what was known of the object is not true of this one
        return trackable(plan.sensor, stated), changes | unsure | {"before": stated}
    return None, changes


def _settled(plan: Plan, state: CalibrationState) -> TrackState:
    """Return the state of a new tracker that has seen the last frames."""
    model = plan.tracker(state.scene, state.calibrated)
    frames = state.recent.select(slice(-_BEGUN_WITH, None)).frames
    return model.first if frames is None else step(model, model.first, frames)[0]


def _said(plan: Plan, state: CalibrationState, at: TrackState, frame: Frames) -> dict[str, Any]:
    """Return what is known of the scene, and what is said of a frame."""
    model: Tracker = plan.tracker(state.scene, state.calibrated)
    _, track = step(model, at, frame)
    range_m, sd_m = float(track.range_m[0]), float(track.sd_m[0])
    return {
        "scene": knowledge(plan.sensor, state.scene),
        "status": Status(int(track.status[0])).name.lower(),
        "range_m": range_m if math.isfinite(range_m) else None,
        "sd_m": sd_m if math.isfinite(sd_m) else None,
    }
