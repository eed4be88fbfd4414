"""Estimates at once: readings in, all physical ranges out, at once."""

from collections.abc import Sequence

from inference.estimates import Estimates, TechniqueResult
from inference.in_turn import estimates_in_turn, last_of
from inference.known import known_of
from inference.plan import Plan, obstacle, plan
from inference.realtime.registry import TECHNIQUES
from inference.temperature import solved_where_told, task_of
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.joint_scene import centre
from simulator.scene import Scene
from simulator.scene_checks import check_scene
from simulator.sensor import Sensor

__all__ = ["all_roots", "estimate", "estimate_planned"]


def estimate(
    sensor: Sensor, scene: Scene, frames: Frames, techniques: Sequence[str] | None = None
) -> Estimates:
    """Estimate the range of every frame.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    scene : Scene
        What is known of the scene. Of priors the supports are used, and as where a fit over many
        frames begins to look; of those of the crosstalk medians and widths, by techniques that take
        its numbers off, where the light is far above them. Of a joint law techniques of single
        frames take the numbers at its centre. What either leaves open is the part ``scene`` of
        every standard deviation.
    frames : Frames
        The readings.
    techniques : sequence of str, optional
        Names in docs/techniques.md; left out, the plan chooses one.

    Returns
    -------
    Estimates
        One result for each technique asked for that the scene can serve, in that order.

    Raises
    ------
    InvalidInputError
        With pointers relative to the request: ``/scene/...``, ``/techniques/i`` for an unknown
        name, ``/frames/time_s`` for times that do not increase where a derivative is asked for.
    """
    try:
        check_scene(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    return estimate_planned(sensor, scene, frames, plan(sensor, scene, frames), techniques)


def estimate_planned(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    choice: Plan,
    techniques: Sequence[str] | None = None,
) -> Estimates:
    """Estimate as `estimate` does, of a checked scene, by a plan that was made.

    Parameters
    ----------
    sensor, scene, frames, techniques
        As for `estimate`.
    choice : Plan
        Of `inference.plan.plan`.

    Returns
    -------
    Estimates
        As of `estimate`.

    Raises
    ------
    InvalidInputError
        As of `estimate`.
    """
    return last_of(estimates_in_turn(sensor, scene, frames, choice, techniques))


def all_roots(
    technique: str, sensor: Sensor, scene: Scene, frames: Frames, high_m: float | None = None
) -> TechniqueResult:
    """Return every positive solution of a technique's equation, without physical filters.

    Parameters
    ----------
    technique : str
        Its name.
    sensor, scene, frames
        As for `estimate`.
    high_m : float, optional
        Upper end of the interval searched [m], in place of the technique's own.

    Returns
    -------
    TechniqueResult
        A phase that noise puts below zero keeps its aliases here.

    Raises
    ------
    InvalidInputError
        At ``/technique`` if it is unknown or the scene cannot serve it.
    """
    if technique not in TECHNIQUES:
        raise InvalidInputError.at("/technique", f"{technique!r} is not a real-time technique")
    sensor, scene = centre(sensor, scene)
    known = known_of(scene, sensor)
    reason = obstacle(TECHNIQUES[technique], sensor, scene, known, frames)
    if reason is not None:
        raise InvalidInputError.at("/technique", reason)

    def solve(used: Frames) -> TechniqueResult:
        task = task_of(sensor, scene, used, known, physical=False, high_m=high_m)
        return TECHNIQUES[technique].solve(task)

    return solved_where_told(sensor, frames, solve)
