"""All that a stream which calibrates itself remembers between frames, in memory and as bytes."""

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.archive import pack, pack_parts, unpack, unpack_parts
from inference.self_calibration.calibration import Asked, Outcome
from inference.self_calibration.drift import Drift
from inference.self_calibration.gathering import Kept
from inference.tracking.state import BROKEN, TrackState, state_from_bytes, state_to_bytes
from simulator.errors import InvalidInputError
from simulator.scene import Scene, parse_scene

__all__ = ["CalibrationState", "Switch", "calibration_from_bytes", "calibration_to_bytes"]

_KIND = "self calibration 1"


@dataclasses.dataclass(frozen=True)
class Switch:
    """What changes at a frame to come.

    Attributes
    ----------
    applies_at : int
        Least number of that frame.
    outcome : Outcome or None
        Of the calibration that was asked for; None where the scene in force is given up.
    reason : str
        Why.
    """

    applies_at: int
    outcome: Outcome | None
    reason: str


@dataclasses.dataclass(frozen=True, eq=False)
class CalibrationState:
    """A stream that calibrates itself, after a frame.

    Attributes
    ----------
    track : TrackState
        The tracker's.
    scene : Scene
        The scene in force, of which every unknown has a law.
    calibrated : bool
        Whether it comes from a calibration.
    known : bool
        Whether it is known well enough.
    trusts_empty : bool
        Whether it is known so well that the tracker can tell when the object is away.
    before : Scene
        What is known before the next calibration.
    recent, gathered : Kept
        The last frames, and those that tell much.
    count : int
        Frames so far.
    since : int
        Of them, those that had come when gathering began.
    not_before : int
        How many must have come when the next calibration is asked for.
    points : int
        Worth of the frames of the last one.
    failures : int
        Calibrations that were not taken since one was.
    doubts : int
        Calibrations to come that are mixed with the scene in force: whether what changed is all
        that they take it for, no frame may show.
    surprises : int
        Frames since the last look that speak against the scene in force.
    surprised : int
        Looks one after the other at which most frames were such.
    number : int
        Calibrations so far.
    taken_at : int
        How many frames had come when the last one was taken.
    asked : Asked or None
        The one that is wanted.
    switch : Switch or None
        What is to change.
    steps, grew_at : int
        Different amplitudes that are gathered, and how many frames had come when they grew.
    widest, widest_at : float
        Before a calibration the largest standard deviation of late, as a share of the range, as of
        the last frame with one range; and its time [s].
    drift : Drift or None
        How old what is known is; None before it is known.
    events : tuple of dict
        The last changes.
    """

    track: TrackState
    scene: Scene
    before: Scene
    recent: Kept
    gathered: Kept
    calibrated: bool = False
    known: bool = False
    trusts_empty: bool = False
    count: int = 0
    since: int = 0
    not_before: int = 0
    points: int = 0
    failures: int = 0
    doubts: int = 0
    surprises: int = 0
    surprised: int = 0
    number: int = 0
    taken_at: int = 0
    asked: Asked | None = None
    switch: Switch | None = None
    steps: int = 0
    grew_at: int = 0
    widest: float = 0.0
    widest_at: float = 0.0
    drift: Drift | None = None
    events: tuple[Mapping[str, Any], ...] = ()


_PLAIN = (
    "calibrated", "known", "trusts_empty", "count", "since", "not_before", "points", "failures",
    "doubts", "surprises", "surprised", "number", "taken_at", "steps", "grew_at",
    "widest", "widest_at",
)  # fmt: skip


def calibration_to_bytes(state: CalibrationState) -> bytes:
    """Write a state as a numpy archive without pickle; every bit survives."""
    arrays: dict[str, NDArray[Any]] = {
        "track": np.frombuffer(state_to_bytes(state.track), dtype=np.uint8)
    }
    meta: dict[str, Any] = {name: getattr(state, name) for name in _PLAIN}
    meta |= {"kind": _KIND, "scene": _text(state.scene), "before": _text(state.before)}
    for name, kept in (("recent", state.recent), ("gathered", state.gathered)):
        arrays[f"{name}.sequence"], arrays[f"{name}.kind"] = kept.sequence, kept.kind
        meta[name] = pack_parts(kept.frames, f"{name}.frames", arrays)
    if state.asked is not None:
        asked = {field.name: getattr(state.asked, field.name)
                 for field in dataclasses.fields(Asked)}  # fmt: skip
        asked["scene"] = _text(state.asked.scene)
        asked["frames"] = pack_parts(state.asked.frames, "asked.frames", arrays)
        meta["asked"] = asked
    if state.switch is not None:
        outcome = state.switch.outcome
        said = None
        if outcome is not None:
            scene = None if outcome.scene is None else _text(outcome.scene)
            said = [scene, outcome.reason, outcome.misfit, dict(outcome.statuses)]
        meta["switch"] = [state.switch.applies_at, said, state.switch.reason]
    if state.drift is not None:
        meta["drift"] = [_text(state.drift.law), *state.drift[1:]]
    meta["events"] = [dict(event) for event in state.events]
    return pack(meta, arrays)


def calibration_from_bytes(data: bytes) -> CalibrationState:
    """Read what `calibration_to_bytes` wrote.

    Raises
    ------
    InvalidInputError
        At "/state" where the bytes are something else.
    """
    try:
        meta, arrays = unpack(data)
        if meta["kind"] != _KIND:
            raise ValueError(meta["kind"])
        kept = {
            name: Kept(
                unpack_parts(meta[name], arrays), arrays[f"{name}.sequence"], arrays[f"{name}.kind"]
            )
            for name in ("recent", "gathered")
        }
        asked = switch = None
        if "asked" in meta:
            parts = meta["asked"]
            parts["sequence"] = tuple(parts["sequence"])
            parts["scene"] = _scene(parts["scene"])
            parts["frames"] = unpack_parts(parts["frames"], arrays)
            asked = Asked(**parts)
        if "switch" in meta:
            applies_at, said, reason = meta["switch"]
            outcome = None
            if said is not None:
                scene = None if said[0] is None else _scene(said[0])
                outcome = Outcome(scene, *said[1:])
            switch = Switch(applies_at, outcome, reason)
        drift = None
        if "drift" in meta:
            law, *numbers = meta["drift"]
            drift = Drift(_scene(law), *numbers)
        return CalibrationState(
            track=state_from_bytes(arrays["track"].tobytes()),
            scene=_scene(meta["scene"]),
            before=_scene(meta["before"]),
            recent=kept["recent"],
            gathered=kept["gathered"],
            asked=asked,
            switch=switch,
            drift=drift,
            events=tuple(meta["events"]),
            **{name: meta[name] for name in _PLAIN if name in meta},
        )
    except BROKEN as error:
        raise InvalidInputError.at("/state", "is not the state of such a stream") from error


def _text(scene: Scene) -> str:
    return json.dumps(scene.model_dump(mode="json", exclude_none=True))


def _scene(text: str) -> Scene:
    return parse_scene(json.loads(text))
