"""The look that is taken at a stream from time to time: gather, doubt, ask for a calibration."""

import dataclasses

import numpy as np
import scipy

from inference.self_calibration.calibration import Asked, seed_of
from inference.self_calibration.gathering import EMPTY, Worth, joined, nothing_kept, thinned
from inference.self_calibration.plan import Plan
from inference.self_calibration.scenes import about_object, prior_scene, unknowns_of
from inference.self_calibration.state import CalibrationState, Switch

__all__ = ["EVERY", "look"]

EVERY = 30
"""Frames between two looks: what is decided does not depend on how a stream is cut."""

_OLDEST = 5400  # numbers behind the last one that still tell of the scene as it is
_DOUBTFUL = 2  # looks one after the other at which most frames surprise
_LASTING = 600  # frames after which a scene that is given up was true of the object at least
_STEPS, _STEPS_BESIDE_OBJECT, _EMPTY = 8, 6, 8
_PATIENCE = 1800  # frames after which what there is has to do
_FEWEST = 8
_GROWTH = 1.25  # of the worth, for another calibration while the scene is not known well
_FALSE_ALARM = 1e-6  # of the mean of empty frames, a look


def look(plan: Plan, state: CalibrationState, sequence: int) -> CalibrationState:
    """Take a look.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream; its count is a multiple of `EVERY`.
    sequence : int
        Number of its last frame.

    Returns
    -------
    CalibrationState
    """
    surprised = state.surprised + 1 if state.surprises > EVERY // 2 else 0
    new = state.recent.select(slice(-EVERY, None))
    gathered = thinned(joined(state.gathered, new), sequence - _OLDEST)
    state = dataclasses.replace(state, gathered=gathered, surprises=0, surprised=surprised)
    if state.calibrated and state.switch is None:
        if surprised >= _DOUBTFUL:
            return _doubted(plan, state, sequence, "most frames contradict the scene")
        if _empty_moved(plan, state):
            return _doubted(plan, state, sequence, "frames without the object have moved")
    if state.asked is None and state.switch is None:
        return _asking(plan, state, sequence)
    return state


def _doubted(plan: Plan, state: CalibrationState, sequence: int, reason: str) -> CalibrationState:
    """Give up the scene in force from the next frame on: what came before tells of another one."""
    stated = prior_scene(plan.stated)
    # what was given up so soon may never have been true, of the object neither
    lasted = state.count - state.taken_at >= _LASTING
    before = (about_object(state.scene, stated) if lasted else None) or stated
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
    )


def _empty_moved(plan: Plan, state: CalibrationState) -> bool:
    """Tell whether the mean of the last empty frames is not what the scene says of it."""
    model = plan.tracker(state.scene, state.calibrated)
    gathered = state.gathered
    empty = gathered.kind == EMPTY
    if gathered.frames is None or empty.sum() < _EMPTY or model.observed.by_rate:
        return False
    if model.learns_crosstalk or not state.trusts_empty:
        return False
    used = np.asarray(model.observed.used)
    frames = gathered.frames.select(empty)
    values = (frames.readings * model.observed.scale)[:, used]
    gain = 1.0 if frames.gain is None else float(frames.gain.mean())
    table, expected = model.model.table, model.model.places.empty
    crosstalk = np.array([table.crosstalk1, table.crosstalk2])
    mean = (gain * expected[:, 0] + crosstalk)[used]
    root = (gain * expected[:, 1:])[used]
    noise = np.maximum(values.var(axis=0, ddof=1), 1.0) / len(values)
    off = values.mean(axis=0) - mean
    whole = root @ root.T + np.diag(noise)
    scale = np.sqrt(np.diagonal(whole))
    solved = np.linalg.solve(whole / scale[:, None] / scale, off / scale)
    surprise = float((off / scale) @ solved)
    return bool(surprise > scipy.stats.chi2.isf(_FALSE_ALARM, off.size))


def _asking(plan: Plan, state: CalibrationState, sequence: int) -> CalibrationState:
    """Ask for a calibration, where it is wanted and may succeed."""
    worth, gathered = state.gathered.worth, state.gathered
    if state.trusts_empty or state.count < state.not_before or gathered.frames is None:
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
        reason=_reason(state),
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
    joint = state.before.joint
    told = () if joint is None else joint.unknowns
    free = set(unknowns_of(plan.sensor, state.before)) - set(told)
    if not any(name.startswith("object.") for name in free):
        return worth.steps >= _STEPS_BESIDE_OBJECT or worth.empty >= _EMPTY
    return worth.steps >= _STEPS


def _reason(state: CalibrationState) -> str:
    if state.calibrated:
        return "frames tell more by now"
    return "the scene is not known" if not state.failures else "the last one was not taken"
