"""What is known of a scene grows old from look to look, and is renewed by frames without object."""

import dataclasses

import numpy as np
import scipy

from inference.self_calibration.calibration import Asked
from inference.self_calibration.change import has_changed
from inference.self_calibration.drift import (
    Drift,
    EmptyMeans,
    aged,
    conditioned,
    crosstalk_of,
    drift_sd,
    walked,
)
from inference.self_calibration.gathering import EMPTY, surprising
from inference.self_calibration.plan import Plan
from inference.self_calibration.state import CalibrationState
from inference.tracking.state import TrackState
from inference.tracking.track import step
from simulator.frames import Frames
from simulator.scene import Scene

__all__ = [
    "EMPTY_ENOUGH",
    "awake",
    "changed",
    "further",
    "in_force",
    "known_since",
    "last_time",
    "old_from",
    "renewed",
    "settled",
    "wide_enough",
    "widened",
    "worn",
]

EMPTY_ENOUGH = 8
_BEGUN_WITH = 90  # frames that a new tracker has seen when it answers its first
_AHEAD = 1.5  # times its age for which a law is widened at once
_LEAST_AHEAD_S = 1.0
_RENEWED_S = 4.0  # age from which on frames without the object renew a law
_FALSE_ALARM = 1e-6  # of the mean of empty frames
_JUMPS = (0.4, 0.9)  # of the crosstalk: steps of a law that frames contradict
_EXPLAINED = 2.0  # running surprise, in the mean and at last, of frames that a wider law explains
_BETWEEN_S = 5.0  # between frames before and after a change
_WORN = 1.0  # times its standard deviation that the crosstalk may have walked since


def further(drift: Drift | None) -> Drift | None:
    """Return a law that is wider by the next step of a jump; None where it is to be given up."""
    if drift is None or not drift.until_s < float("inf"):
        return None
    steps = [jump for jump in _JUMPS if jump > drift.jump]
    return drift._replace(jump=steps[0]) if steps else None


def wide_enough(
    plan: Plan, drift: Drift | None, frames: Frames | None, now_s: float
) -> Drift | None:
    """Return a law as wide as frames demand.

    Parameters
    ----------
    drift : Drift or None
        The law.
    frames : Frames or None
        Frames that it is to explain.
    now_s : float
        Time of the last of them [s].

    Returns
    -------
    Drift or None
        None where they contradict it however wide it is.
    """
    while drift is not None and frames is not None:
        drift, scene = widened(plan, drift, now_s)
        model = plan.tracker(scene)
        _, track = step(model, model.first, frames)
        beyond = 2 * int(surprising(track).sum()) > len(track)
        # what an error that all frames share does to them, a surprise of 3 allows by far
        most = max(float(track.surprise.mean()), float(track.surprise[-1]))
        if not beyond and (drift.jump == 0.0 or most <= _EXPLAINED):
            return drift
        drift = further(drift)
    return drift


def changed(plan: Plan, state: CalibrationState) -> Drift | None:
    """Return a law that is wider by a step, where the last frames lie on another curve.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream, calibrated.
    """
    kept = state.recent.select(slice(-max(state.count - state.since, 1), None))
    if (drift := state.drift) is None or not drift.until_s < float("inf") or kept.frames is None:
        return None
    known = crosstalk_of(plan.sensor, drift.law)
    walk = drift_sd(plan.sensor, drift, _BETWEEN_S, plan.settings.crosstalk_drift)
    if known is None or walk is None:
        return None
    widest = _JUMPS[-1] * (np.abs(known[0]) + known[1])
    model = plan.tracker(state.scene)
    if not has_changed(model, kept.frames, kept.kind >= 0, walk, widest):
        return None
    return drift._replace(jump=max(drift.jump, _JUMPS[0]))


def settled(plan: Plan, state: CalibrationState) -> TrackState:
    """Return the state of a new tracker that has seen the last frames once more."""
    model = plan.tracker(state.scene)
    frames = state.recent.select(slice(-_BEGUN_WITH, None)).frames
    return model.first if frames is None else step(model, model.first, frames)[0]


def known_since(plan: Plan, state: CalibrationState, law: Scene, asked: Asked | None) -> Drift:
    """Return how old a calibration is when it is taken, and what it tells of the walk.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream before it.
    law : Scene
        The calibrated scene.
    asked : Asked or None
        Its frames. Those without the object tell the crosstalk where there are some.
    """
    last = last_time(state)
    at = last
    if asked is not None and asked.frames.time_s is not None:
        empty = ~asked.frames.present
        times = asked.frames.time_s
        at = float(times[empty].mean() if empty.sum() >= EMPTY_ENOUGH else times.mean())
    drift = Drift(law, at, at)
    if (old := state.drift) is None:
        return drift
    drift = drift._replace(counted=old.counted, square=old.square)
    known, found = crosstalk_of(plan.sensor, old.law), crosstalk_of(plan.sensor, law)
    return drift if known is None or found is None else walked(drift, known, found, at - old.at_s)


def widened(plan: Plan, drift: Drift, now_s: float) -> tuple[Drift, Scene]:
    """Return the scene that is wide enough for the walk up to a time, and some time beyond it."""
    ahead = max(_AHEAD * (now_s - drift.at_s), _LEAST_AHEAD_S)
    sd = drift_sd(plan.sensor, drift, ahead, plan.settings.crosstalk_drift)
    if sd is None:
        return drift._replace(until_s=float("inf")), drift.law
    first, second = plan.sensor.columns
    scene = aged(drift.law, (f"crosstalk.{first}", f"crosstalk.{second}"), sd)
    return drift._replace(until_s=drift.at_s + ahead), scene


def renewed(
    plan: Plan, state: CalibrationState, looked_at: int
) -> tuple[CalibrationState, str | None]:
    """Let the scene in force grow older, and learn from the last frames without the object.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream, calibrated.
    looked_at : int
        How many of the last frames are new.

    Returns
    -------
    (CalibrationState, str or None)
        What frames without the object contradict, if they do.
    """
    if plan.settings.observables == "derivatives":
        return state, None
    now = last_time(state)
    drift, moved = state.drift, False
    if drift is None:
        drift = Drift(state.scene, now, now)
    means = _without_object(plan, state, looked_at)
    if means is not None and drift.until_s < float("inf"):
        after, moved = _conditioned(plan, drift, means)
        if moved or means.time_s - drift.at_s >= _RENEWED_S:
            drift = after
    if moved:  # the law takes over with the next frame, which tells what was known before
        state = dataclasses.replace(state, drift=drift)
        return state, "frames without the object have moved"
    if drift is not state.drift or now > drift.until_s:
        state = in_force(plan, state, drift)
    return state, None


def awake(plan: Plan, state: CalibrationState, now_s: float) -> CalibrationState:
    """Widen the scene in force before a frame for which it is too old, as after a sleep.

    Parameters
    ----------
    plan, state : Plan, CalibrationState
        The stream.
    now_s : float
        Time of the frame [s].
    """
    if state.drift is None or not now_s > old_from(state):
        return state
    return in_force(plan, state, state.drift, now_s)


def old_from(state: CalibrationState) -> float:
    """Return the time from which on the scene in force is too old; inf where it never is."""
    if not state.calibrated or state.drift is None:
        return float("inf")
    return state.drift.until_s


def in_force(
    plan: Plan, state: CalibrationState, drift: Drift, now_s: float | None = None
) -> CalibrationState:
    """Put a law in force, as wide as it has to be at a time, left out that of the last frame."""
    drift, scene = widened(plan, drift, last_time(state) if now_s is None else now_s)
    state = dataclasses.replace(state, drift=drift)
    if scene == state.scene:
        return state
    state = dataclasses.replace(state, scene=scene)
    return dataclasses.replace(state, track=settled(plan, state))


def _conditioned(plan: Plan, drift: Drift, means: EmptyMeans) -> tuple[Drift, bool]:
    """Return a law that has learnt from frames without the object, and whether it had to jump."""
    limit = scipy.special.chdtri(int(np.isfinite(means.sd).sum()), _FALSE_ALARM)
    wide = drift
    while True:
        _, before = widened(plan, wide, means.time_s)
        law, surprise = conditioned(plan.sensor, before, means)
        more = further(wide)
        if surprise <= limit:
            break
        if more is None:
            return drift._replace(jump=float("inf")), True
        wide = more
    after = drift._replace(law=law, at_s=means.time_s, until_s=means.time_s)
    known, found = crosstalk_of(plan.sensor, drift.law), crosstalk_of(plan.sensor, law)
    if known is not None and found is not None:
        after = walked(after, known, found, means.time_s - drift.at_s)
    return after, wide is not drift


def last_time(state: CalibrationState) -> float:
    """Return the time of the last frame [s]; 0 before any."""
    frames = state.recent.frames
    if frames is None or frames.time_s is None:
        return 0.0
    return float(frames.time_s[-1])


def _without_object(plan: Plan, state: CalibrationState, looked_at: int) -> EmptyMeans | None:
    """Return the mean reading of the last frames without the object, where there are enough."""
    new = state.recent.select(slice(-looked_at, None))
    empty = new.kind == EMPTY
    if new.frames is None or empty.sum() < EMPTY_ENOUGH:
        return None
    frames: Frames = new.frames.select(empty)
    observed = plan.tracker(state.scene).observed
    read = np.asarray(plan.sensor.noise.read)
    variance = np.maximum(frames.readings.var(axis=0, ddof=1), read**2) / len(frames)
    return EmptyMeans(
        frames.readings.mean(axis=0),
        np.where(observed.used, np.sqrt(variance), np.inf),
        1.0 if frames.gain is None else float(frames.gain.mean()),
        0.0 if frames.time_s is None else float(frames.time_s.mean()),
    )


def worn(plan: Plan, state: CalibrationState) -> bool:
    """Tell whether most of what was known of the crosstalk is lost by its walk."""
    drift = state.drift
    if drift is None or (known := crosstalk_of(plan.sensor, drift.law)) is None:
        return False
    sd = drift_sd(plan.sensor, drift, last_time(state) - drift.at_s, plan.settings.crosstalk_drift)
    return sd is not None and bool((sd > _WORN * known[1]).any())
