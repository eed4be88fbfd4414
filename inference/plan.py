"""Which technique a scene needs, and why the others are left out."""

import dataclasses
import math
from collections.abc import Iterable

import numpy as np

from inference.estimates import LeftOut
from inference.known import Known, known_of
from inference.realtime.registry import TECHNIQUES as REALTIME
from inference.realtime.turns import (
    MOST_HALF_TURNS,
    half_turns,
    often_beyond,
    several_turns,
)
from inference.technique import Technique
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from simulator.errors import listed
from simulator.frames import Frames
from simulator.joint_scene import centre
from simulator.remembered import remembered
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor
from simulator.sensor_unknowns import DRIFTS, GAIN

__all__ = ["Plan", "asked_with", "cheapest", "obstacle", "plan"]

_OF_GAIN = (GAIN, DRIFTS[0])
# yields to the other where this has one root: its intervals are three times as wide, of a wall's
# shadow, and the other takes next to as long (python -m benchmarks.flat_wall)
_WIDE, _SHARP = "background_intensity", "background_cancelling"
# yields to the other where the stated ranges hold several turns of phase, which the other tells
_PHASE, _AMOUNT = "conventional", "intensity"
_JOINT = "joint_fit"
_SHAPE = ("object.c0", "object.c1")
_ONE_ROOT = -math.sqrt(32.0 / 9.0)  # of sqrt(c0), from which on light falls with range
_FEW = 1000  # frames whose estimates take no longer than their plan


@dataclasses.dataclass(frozen=True)
class Plan:
    """The technique that a scene needs.

    Attributes
    ----------
    chosen : str or None
        The cheapest technique that is immune to what the scene has; None if there is none.
    left_out : tuple of LeftOut
        Every other technique with its reason.
    """

    chosen: str | None
    left_out: tuple[LeftOut, ...]


def asked_with(name: str, sensor: Sensor, scene: Scene) -> tuple[Sensor, Scene]:
    """Return sensor and scene as a technique takes them where the scene has a joint law.

    Parameters
    ----------
    name : str
        The technique. Of single frames it takes numbers, those at the centre of the law; a fit over
        many frames takes the law as it is.
    sensor, scene : Sensor, Scene
        The request, checked.
    """
    return centre(sensor, scene) if name in REALTIME else (sensor, scene)


def obstacle(
    technique: Technique, sensor: Sensor, scene: Scene, known: Known, frames: Frames | None
) -> str | None:
    """Return why a technique cannot serve a scene, None if it can.

    Parameters
    ----------
    known : Known
        The scene's known numbers.
    frames : Frames, optional
        Left out: frames with times are supposed.
    """
    if sensor.kind not in technique.kinds:
        return "a sine wave has no late window"
    if technique.differential:
        if technique.uses_background and scene.motion == "tangential":
            return "needs radial motion: a range that does not change leaves the background alone"
        if scene.motion == "static":
            return "needs motion: the scene's range does not change"
        if frames is not None and frames.derivatives is None:
            if frames.time_s is None:
                return "needs derivative columns, or time_s to form differences"
            least, told = (2, "two") if scene.motion == "tangential" else (3, "three")
            if len(frames) < least:
                return f"needs derivative columns, or at least {told} frames to form differences"
    if known.crosstalk is None and "crosstalk" not in technique.immune_to:
        state = "optional" if "crosstalk" in scene.optional_terms else "unknown"
        return f"is not immune to crosstalk, and the scene's is {state}"
    if scene.background is None:
        if technique.uses_background:
            return "is made for a background, and the scene states none"
    elif "background" not in technique.immune_to:
        return "is not immune to the scene's background"
    elif isinstance(sensor, SineWaveSensor) and technique.uses_background:
        turns = _half_turns(sensor, scene)
        if turns > MOST_HALF_TURNS:
            return (
                f"the background lies {turns:.3g} half turns of phase away, and a frame may have "
                "as many roots; a lower frequency would tell them apart"
            )
    if (of_turns := _turns_obstacle(technique, sensor, scene, known)) is not None:
        return of_turns
    of_sensor = _sensor_obstacle(technique, sensor, scene, known)
    if of_sensor is not None:
        return of_sensor
    missing = [path for path in technique.needs if not known.has(path)]
    if missing:
        return f"needs {listed(missing)} as known numbers"
    if technique.obstacle is not None:
        return technique.obstacle(sensor, scene, known, frames)
    return None


def _turns_obstacle(technique: Technique, sensor: Sensor, scene: Scene, known: Known) -> str | None:
    """Return why a technique cannot serve ranges of several turns of phase, None if it can."""
    if technique.name not in REALTIME:
        # of the turns of its frames a joint fit asks itself
        joint = _JOINT in (technique.name, technique.same_as)
        if joint or not often_beyond(sensor, scene, known):
            return None
        return (
            f"the stated range_m goes on beyond {sensor.max_range_m:.4g} m, where the phase begins "
            "anew, and this fit takes its ranges frame by frame; take joint_fit, or a posterior"
        )
    turns = half_turns(sensor, known)
    # the amount of light has no turns, and a wall ends what it serves
    if technique.name == _AMOUNT or technique.uses_background or turns <= MOST_HALF_TURNS:
        return None
    return (
        f"the stated range_m holds {turns:.3g} half turns of phase, and a frame may have as many "
        "roots; narrow it, or take a lower frequency"
    )


def _sensor_obstacle(
    technique: Technique, sensor: Sensor, scene: Scene, known: Known
) -> str | None:
    """Return why a technique cannot serve a sensor that is not calibrated, None if it can."""
    fits = technique.name not in REALTIME
    of = sensor.temperature
    if of is not None and of.delay_drift_s_per_k is not None and known.crosstalk is None:
        return (
            "the sensor's delay follows its temperature and crosstalk does not: crosstalk has to "
            "be a number to be taken apart here; a posterior of these frames takes a prior"
        )
    if fits and isinstance(sensor, PulsedSensor) and sensor.timing_offset_s is not None:
        return "fits over many frames take no timing_offset_s; a posterior of these frames does"
    missing = [
        path
        for path in sensor.unknown
        if fits
        or (path in _OF_GAIN and "object.c2" in technique.needs)
        # neither w2 nor the modulus depends on when light comes
        or (path not in _OF_GAIN and technique.name != "intensity")
    ]
    if missing and scene.joint is not None and set(missing) <= set(scene.joint.unknowns):
        return (
            f"needs {listed(missing)} as known numbers, and of a calibrated scene has their law; a "
            "posterior of these frames (hybridtof infer) takes it"
        )
    if missing:
        return (
            f"needs {listed(missing)} as known numbers: the sensor states priors, and a posterior "
            "of frames of known range learns them, for a calibrated scene"
        )
    return None


def cheapest(names: Iterable[str], sensor: Sensor, scene: Scene) -> str | None:
    """Return the technique of least cost, None of none; a sharper one before a known background.

    Parameters
    ----------
    names : iterable of str
        Techniques by name.
    sensor, scene : Sensor, Scene
        The request: `background_cancelling` has one root where a background lies no farther than
        half a turn of phase, and then goes before `background_intensity`. `intensity` goes before
        `conventional` where that has a root in several turns.
    """
    left = set(names)
    if _SHARP in left and _half_turns(sensor, scene) <= 1.0:
        left.discard(_WIDE)
    if _AMOUNT in left and _amount_tells_turns(sensor, scene):
        left.discard(_PHASE)
    return min(left, key=lambda name: ALL_TECHNIQUES[name].cost, default=None)


def _amount_tells_turns(sensor: Sensor, scene: Scene) -> bool:
    """Tell whether the light of a known object is of one range, and its phase is of several."""
    of, stated = centre(sensor, scene)
    known = known_of(stated, of)
    if not (several_turns(of, known, of.max_range_m) and known.has(*_SHAPE)):
        return False
    c0, c1 = (known.get(path) for path in _SHAPE)
    return c1 >= _ONE_ROOT * math.sqrt(c0)


def _half_turns(sensor: Sensor, scene: Scene) -> float:
    """Return the half turns of phase to a background of known distance; 0 of a pulse."""
    if scene.background is None or not isinstance(sensor, SineWaveSensor):
        return 0.0
    distance = scene.background.distance_m
    return sensor.wave_number * distance / math.pi if isinstance(distance, float | int) else 0.0


def plan(sensor: Sensor, scene: Scene, frames: Frames | None = None) -> Plan:
    """Choose the cheapest technique that is immune to what the scene has.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    scene : Scene
        The scene.
    frames : Frames, optional
        Whether they hold times or derivatives; left out, times are supposed.

    Returns
    -------
    Plan
        The choice, and the reason against each other technique.
    """
    if frames is None or len(frames) > _FEW:
        return _planned(sensor, scene, frames)
    ruling_out = frames.object_present, sensor.full_scale, sensor.temperature
    if any(each is not None for each in ruling_out):
        return _planned(sensor, scene, frames)  # some of the frames may be ruled out
    timed, derived = frames.time_s is not None, frames.derivatives is not None
    return _planned_for(sensor, scene, len(frames), timed, derived)


@remembered
def _planned_for(sensor: Sensor, scene: Scene, n: int, timed: bool, derived: bool) -> Plan:
    """Plan for frames of which all that matters is told."""
    frames = Frames(
        np.zeros((n, 2)), np.zeros(n) if timed else None, np.zeros((n, 2)) if derived else None
    )
    return _planned(sensor, scene, frames)


def _planned(sensor: Sensor, scene: Scene, frames: Frames | None) -> Plan:
    obstacles = {}
    for name, technique in ALL_TECHNIQUES.items():
        of, stated = asked_with(name, sensor, scene)
        obstacles[name] = obstacle(technique, of, stated, known_of(stated, of), frames)
    able = [name for name, reason in obstacles.items() if reason is None]
    chosen = cheapest(able, *centre(sensor, scene))
    left_out = [
        LeftOut(name, reason if reason is not None else _served_better(name, chosen))
        for name, reason in obstacles.items()
        if name != chosen
    ]
    left_out += [LeftOut(name, reason) for name, reason in ELSEWHERE.items()]
    return Plan(chosen, tuple(left_out))


def _served_better(name: str, chosen: str | None) -> str:
    how = "at less cost"
    if (name, chosen) == (_WIDE, _SHARP):
        how = "with less error"
    elif (name, chosen) == (_PHASE, _AMOUNT):
        how = "and tells the turns of phase"
    return f"{chosen} serves the scene {how}"
