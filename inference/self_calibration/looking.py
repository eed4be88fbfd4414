"""The look that is taken at a stream from time to time: gather, doubt, ask for a calibration."""

import dataclasses
import math

from inference.self_calibration.ageing import (
    EMPTY_ENOUGH,
    changed,
    further,
    in_force,
    last_time,
    renewed,
    wide_enough,
    worn,
)
from inference.self_calibration.calibration import Asked, seed_of
from inference.self_calibration.gathering import EMPTY, Worth, in_order, nothing_kept, thinned
from inference.self_calibration.plan import Plan
from inference.self_calibration.scenes import about_object, open_names, prior_scene
from inference.self_calibration.state import CalibrationState, Switch

__all__ = ["EVERY", "look"]

EVERY = 30
"""Frames between two looks: what is decided does not depend on how a stream is cut."""

_OLDEST = 5400  # numbers behind the last one that still tell of the scene as it is
_DOUBTFUL = 2  # looks one after the other at which most frames surprise
_LASTING = 600  # frames after which a scene that is given up was true of the object at least
_HALVED = 2  # calibrations after a doubt that share what is known with the scene before
_STEPS, _STEPS_BESIDE_OBJECT = 8, 6
_STILL = 150  # frames without an amplitude that is new, after which more is not waited for
_REFRESHED = 3600  # frames after which a scene that is worn is calibrated again
_PATIENCE = 1800  # frames after which what there is has to do
_FEWEST = 8
_GROWTH = 1.25  # of the worth, for another calibration while the scene is not known well


def look(plan: Plan, state: CalibrationState, sequence: int) -> CalibrationState:
    """Take a look.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream; its count is a multiple of `EVERY`.
    sequence : int
        Number of its last frame.
    """
    surprised = state.surprised + 1 if state.surprises > EVERY // 2 else 0
    new = state.recent.select(slice(-EVERY, None))
    gathered = thinned(in_order(state.gathered, new), sequence - _OLDEST)
    steps = gathered.worth.steps
    state = dataclasses.replace(
        state,
        gathered=gathered,
        surprises=0,
        surprised=surprised,
        steps=steps,
        grew_at=state.count if steps > state.steps else state.grew_at,
    )
    if state.calibrated and state.switch is None:
        state, moved = renewed(plan, state, EVERY)
        if moved is not None:
            return _doubted(plan, state, sequence, moved)
        if surprised >= (_DOUBTFUL if further(state.drift) is None else 1):
            return _contradicted(plan, state, sequence)
        if state.known and (wider := changed(plan, state)) is not None:
            state = dataclasses.replace(state, drift=wider)
            return _doubted(plan, state, sequence, "the readings of all ranges have moved")
    if state.asked is None and state.switch is None:
        return _asking(plan, state, sequence)
    return state


def _contradicted(plan: Plan, state: CalibrationState, sequence: int) -> CalibrationState:
    """Widen the scene in force, or give it up; both are told, further widening is not."""
    last = state.recent.select(slice(-EVERY, None)).frames
    wider = wide_enough(plan, further(state.drift), last, last_time(state))
    if wider is None:
        wider = state.drift and state.drift._replace(jump=math.inf)
    elif state.drift is not None and state.drift.jump > 0.0:
        return dataclasses.replace(in_force(plan, state, wider), surprised=0)
    state = dataclasses.replace(state, drift=wider)
    return _doubted(plan, state, sequence, "most frames contradict the scene")


def _doubted(plan: Plan, state: CalibrationState, sequence: int, reason: str) -> CalibrationState:
    """Doubt the scene in force from the next frame on: what came before tells of another one."""
    stated = prior_scene(plan.stated)
    # what was given up so soon may never have been true, of the object neither
    lasted = state.count - state.taken_at >= _LASTING
    law = state.scene if state.drift is None else state.drift.law
    before = (about_object(law, stated) if lasted else None) or stated
    return dataclasses.replace(
        state,
        before=before,
        gathered=nothing_kept(),
        known=False,
        asked=None,
        switch=Switch(sequence + 1, None, reason),
        surprised=0,
        since=state.count,
        not_before=state.count,
        points=0,
        failures=0,
        doubts=_HALVED,
    )


def _asking(plan: Plan, state: CalibrationState, sequence: int) -> CalibrationState:
    """Ask for a calibration, where it is wanted and may succeed."""
    worth, gathered = state.gathered.worth, state.gathered
    if state.count < state.not_before or gathered.frames is None:
        return state
    refreshes = state.calibrated and state.count - state.taken_at >= _REFRESHED
    refreshes = refreshes and worn(plan, state)
    if refreshes:
        state = dataclasses.replace(state, points=0)
    elif state.trusts_empty and state.known:
        return state
    if not _promising(plan, state, worth):
        return state
    number = state.number + 1
    frames = gathered.frames
    if (gathered.kind == EMPTY).any():
        frames = dataclasses.replace(frames, object_present=gathered.kind != EMPTY)
    asked = Asked(
        number=number,
        seed=seed_of(plan.seed, number),
        reason="the crosstalk may have drifted" if refreshes else _reason(state),
        decided_at=sequence,
        sequence=tuple(gathered.sequence.tolist()),
        scene=state.before,
        frames=frames,
    )
    return dataclasses.replace(state, number=number, asked=asked, points=worth.points)


def _promising(plan: Plan, state: CalibrationState, worth: Worth) -> bool:
    if worth.frames < _FEWEST:
        return False
    if state.count - state.since >= _PATIENCE and not state.points:
        return True
    if state.points:
        return worth.points >= _GROWTH * state.points
    still = state.count - state.grew_at >= _STILL
    joint = state.before.joint
    told = () if joint is None else joint.unknowns
    unknowns = open_names(plan.sensor, state.before)
    shaped = [name for name in unknowns if name.startswith("object.")]
    if set(shaped) <= set(told):
        if worth.empty >= EMPTY_ENOUGH:
            return True
        return (still or not shaped) and worth.steps >= _STEPS_BESIDE_OBJECT
    return still and worth.steps >= _STEPS


def _reason(state: CalibrationState) -> str:
    if state.known:
        return "frames tell more by now"
    return "the scene is not known" if not state.failures else "the last one was not taken"
