"""One technique, asked about frames of one scene."""

import dataclasses
import time

import numpy as np

from inference.contradicted import without_moved
from inference.empty_frames import Contradiction
from inference.estimates import LeftOut, TechniqueResult
from inference.known import known_of
from inference.plan import asked_with, obstacle
from inference.realtime.clipped_light import beside_ends, may_come_late
from inference.realtime.registry import TECHNIQUES
from inference.shared_error import with_shared_error
from inference.stated_light import StatedLight, faint, with_scene_part
from inference.technique import Task
from inference.techniques import ALL_TECHNIQUES
from inference.temperature import solved_where_told, task_of
from inference.without_sd import explained
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.joint_scene import around, centre
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["NOT_SMALL", "Said", "by_prior", "obstacle_by_prior", "run"]

_WHOLE_ALONE = frozenset({"intensity"})  # techniques that do not ask when light comes

Said = dict[str, TechniqueResult | str]
"""What techniques said of one request, or why they said nothing; by the names of what differs."""

NOT_SMALL = (
    "is not immune to crosstalk, and what the scene's prior of it leaves open is not small against "
    "the light of any frame: take frames without the object for joint_fit, or state the "
    "prior narrower"
)


def run(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    name: str,
    against: Contradiction | None,
    said: Said,
) -> TechniqueResult | LeftOut:
    """Return what a technique says that serves a scene, or why it says nothing.

    Parameters
    ----------
    sensor, scene, frames : Sensor, Scene, Frames
        The request.
    name : str
        The technique.
    against : Contradiction, optional
        What empty frames say against the scene.
    said : dict
        Of the same request, and filled: what has several names is solved once.
    """
    same = ALL_TECHNIQUES[name].same_as or name
    if same not in said:
        start = time.perf_counter()
        try:
            said[same] = _taken(
                solved_where_told(sensor, frames, lambda used: _solved(sensor, scene, used, name)),
                name,
                time.perf_counter() - start,
            )
        except RefusedError as error:
            said[same] = str(error)
    result = said[same]
    if isinstance(result, str):
        return LeftOut(name, result)
    seconds = result.runtime_s
    if against is not None and _rests_on_numbers(name, scene):
        start = time.perf_counter()
        result = without_moved(result, _beside(sensor, scene, frames, name, against))
        seconds += time.perf_counter() - start
    return _taken(explained(result), name, seconds)


def _rests_on_numbers(name: str, scene: Scene) -> bool:
    """Tell whether a technique takes for granted what empty frames should read."""
    technique = ALL_TECHNIQUES[name]
    if "crosstalk" not in technique.immune_to:
        return True
    if scene.background is None:
        return False
    of_wall = any(path.startswith("background.") for path in technique.needs)
    return of_wall or "background" not in technique.immune_to


def _beside(
    sensor: Sensor, scene: Scene, frames: Frames, name: str, against: Contradiction
) -> TechniqueResult | None:
    """Solve with the light that empty frames show as crosstalk; None where that is refused."""
    of, stated = asked_with(name, sensor, scene)
    crosstalk = known_of(stated, of).crosstalk
    assert crosstalk is not None  # noqa: S101  # nothing contradicts what is unknown
    light = tuple(a + b for a, b in zip(crosstalk, against.light, strict=True))
    lit = stated.model_copy(update={"crosstalk": light})
    try:
        return solved_where_told(of, frames, lambda used: _solved(of, lit, used, name))
    except RefusedError:
        return None


def by_prior(
    sensor: Sensor, light: StatedLight, frames: Frames, name: str, against: Contradiction | None
) -> TechniqueResult | LeftOut:
    """Return what a technique says that rests on the prior of the crosstalk, or why nothing.

    Parameters
    ----------
    sensor : Sensor
        As stated.
    light : StatedLight
        The scene with its crosstalk in numbers.
    frames, name, against
        As of `run`.
    """
    reason = obstacle_by_prior(light, frames, name)
    if reason is not None:
        return LeftOut(name, reason)
    wide = run(light.sensor, light.scene, frames, name, against, {})
    alone = run(sensor, light.scene, frames, name, None, {})
    if isinstance(wide, LeftOut) or isinstance(alone, LeftOut):
        return wide if isinstance(wide, LeftOut) else alone
    result = with_scene_part(light, frames, wide, alone)
    if not np.isfinite(result.roots_sd_m).any():
        return LeftOut(name, NOT_SMALL if against is None else against.said)
    return _taken(explained(result), name, wide.runtime_s + alone.runtime_s)


def obstacle_by_prior(light: StatedLight, frames: Frames, name: str) -> str | None:
    """Return why a technique cannot serve a scene by the prior of its crosstalk, None if it can.

    Parameters
    ----------
    light, frames, name
        As of `by_prior`.
    """
    if faint(light, frames, name).all():
        return NOT_SMALL
    of, stated = centre(light.sensor, light.scene)
    return obstacle(TECHNIQUES[name], of, stated, known_of(stated, of), frames)


def _taken(result: TechniqueResult, name: str, seconds: float) -> TechniqueResult:
    """As `dataclasses.replace`, which takes as long as many an estimate."""
    told = object.__new__(TechniqueResult)
    vars(told).update(vars(result), technique=name, runtime_s=seconds)
    return told


def _solved(sensor: Sensor, scene: Scene, frames: Frames, name: str) -> TechniqueResult:
    solve = ALL_TECHNIQUES[name].solve
    if name not in TECHNIQUES:
        return solve(task_of(sensor, scene, frames, known_of(scene, sensor)))
    if scene.joint is None:
        result = solve(task_of(sensor, scene, frames, known_of(scene, sensor)))
        return _doubted(result, sensor, scene, frames, name)

    def at(of: Sensor, stated: Scene) -> Task:
        known = known_of(stated, of)
        reason = obstacle(ALL_TECHNIQUES[name], of, stated, known, frames)
        if reason is not None:
            raise RefusedError(f"a standard deviation off the scene's centre it {reason}")
        return task_of(of, stated, frames, known, physical=False)

    of, middle = centre(sensor, scene)
    beside = tuple((at(*plus), at(*minus)) for plus, minus in around(sensor, scene))
    result = solve(task_of(of, middle, frames, known_of(middle, of), around=beside))
    pairs = ((solve(plus), solve(minus)) for plus, minus in beside)
    return _doubted(with_shared_error(result, pairs), of, middle, frames, name)


def _doubted(
    result: TechniqueResult, sensor: Sensor, scene: Scene, frames: Frames, name: str
) -> TechniqueResult:
    """Mark ranges of light that may have been moved out of the late window.

    Before a background they are left alone: its light is late, too.
    """
    if not (isinstance(sensor, PulsedSensor) and may_come_late(sensor)):
        return result
    known = known_of(scene, sensor)
    if name in _WHOLE_ALONE or known.crosstalk is None or scene.background is not None:
        return result
    beside = beside_ends(sensor, frames, known.crosstalk, known.support)
    if beside is None:
        return result
    near = result.near_fold | (beside & (result.root_count > 0))
    return dataclasses.replace(result, near_fold=near)
