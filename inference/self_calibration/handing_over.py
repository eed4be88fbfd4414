"""From one scene to the next: told with what was known and said before, and after."""

import dataclasses
import math
from typing import Any

from inference.estimates import Status
from inference.self_calibration.ageing import known_since, last_time, settled, wide_enough, widened
from inference.self_calibration.calibration import Outcome
from inference.self_calibration.drift import Drift
from inference.self_calibration.looking import EVERY
from inference.self_calibration.mixing import mixed
from inference.self_calibration.plan import Plan
from inference.self_calibration.scenes import knowledge, prior_scene, trackable
from inference.self_calibration.state import CalibrationState
from inference.self_calibration.withholding import withheld
from inference.tracking.state import TrackState
from inference.tracking.track import step
from inference.tracking.tracker import Tracker
from simulator.frames import Frames
from simulator.scene import Scene

__all__ = ["hand_over"]

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
    state, drift = _held_against_frames(plan, state)
    switch = state.switch or switch
    scene, changes = _next(plan, state, switch.outcome, drift)
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
        after = dataclasses.replace(after, track=settled(plan, after))
    event["after"] = _said(plan, after, after.track, frame)
    return dataclasses.replace(after, events=(*after.events, event)[-_EVENTS:]), event


def _held_against_frames(
    plan: Plan, state: CalibrationState
) -> tuple[CalibrationState, Drift | None]:
    """Return the state, and how wide an outcome has to be for the last frames.

    Where they contradict it however wide it is, it is not taken.
    """
    switch = state.switch
    # what came before a change tells nothing of the scene behind it
    frames = state.recent.select(slice(-max(state.count - state.since, 1), None)).frames
    if switch is None or switch.outcome is None or (scene := switch.outcome.scene) is None:
        return state, None
    drift = known_since(plan, state, scene, state.asked)
    wide = wide_enough(plan, drift, frames, last_time(state))
    if wide is not None:
        return state, wide
    outcome = Outcome(None, "the last frames contradict it", True, switch.outcome.statuses)
    return dataclasses.replace(state, switch=dataclasses.replace(switch, outcome=outcome)), None


def _next(
    plan: Plan, state: CalibrationState, outcome: Outcome | None, drift: Drift | None
) -> tuple[Scene | None, dict[str, Any]]:
    """Return the next scene in force, where there is one, and what else changes."""
    unsure = {"calibrated": False, "known": False, "trusts_empty": False, "surprised": 0,
              "surprises": 0}  # fmt: skip
    if outcome is None:
        if state.drift is not None and math.isfinite(state.drift.jump):
            drift, scene = widened(plan, state.drift, last_time(state))
            trusts = state.trusts_empty and drift.jump == 0.0
            return scene, unsure | {"calibrated": True, "trusts_empty": trusts, "drift": drift}
        return trackable(plan.sensor, state.before), unsure
    if outcome.scene is not None and drift is not None:
        of_ranges = outcome.statuses.get("range_m", "identified")
        crosstalk = [s for name, s in outcome.statuses.items() if name.startswith("crosstalk.")]
        # frames without the object tell no range, and may tell all that is unknown
        rest = [s for name, s in outcome.statuses.items() if name != "range_m"]
        known = of_ranges != "not_identified" or all(s == "identified" for s in rest)
        known = known and drift.jump == 0.0
        if state.doubts and state.drift is not None and state.calibrated:
            drift = drift._replace(law=mixed(drift.law, state.drift.law))
        drift, scene = widened(plan, drift, last_time(state))
        return scene, {
            "drift": drift,
            "calibrated": True,
            "known": known,
            "trusts_empty": known and all(s == "identified" for s in crosstalk),
            "failures": 0,
            "doubts": max(state.doubts - 1, 0),
            "surprised": 0,
            "surprises": 0,
            "taken_at": state.count,
            "not_before": state.count + _AGAIN,
        }
    failures = state.failures + 1
    wait = _AGAIN * 2 ** min(failures - 1, _MOST_DOUBLED)
    changes = {"failures": failures, "not_before": state.count + wait, "points": 0}
    stated = prior_scene(plan.stated)
    if outcome.misfit and not state.known and state.before != stated:
        # what was known of the object is not true of this one
        changes |= {"before": stated}
        if not state.calibrated:
            return trackable(plan.sensor, stated), changes | unsure
    return None, changes


def _said(plan: Plan, state: CalibrationState, at: TrackState, frame: Frames) -> dict[str, Any]:
    """Return what is known of the scene, and what is said of a frame."""
    model: Tracker = plan.tracker(state.scene)
    _, track = step(model, at, frame)
    if state.calibrated:
        track = withheld(model, frame, track)
    range_m, sd_m = float(track.range_m[0]), float(track.sd_m[0])
    return {
        "scene": knowledge(plan.sensor, state.scene),
        "status": Status(int(track.status[0])).name.lower(),
        "range_m": range_m if math.isfinite(range_m) else None,
        "sd_m": sd_m if math.isfinite(sd_m) else None,
    }
