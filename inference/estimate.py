"""Estimates at once: readings in, all physical ranges out, at once."""

import time
from collections.abc import Sequence

from inference.assumptions import assumptions_of
from inference.contradicted import without_moved
from inference.empty_frames import Contradiction, contradiction
from inference.estimates import Estimates, LeftOut, TechniqueResult
from inference.first_step import beyond_bounds, first_step
from inference.known import known_of
from inference.plan import Plan, cheapest, obstacle, plan
from inference.realtime.registry import TECHNIQUES
from inference.shared_error import with_shared_error
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from inference.temperature import solved_where_told, task_of
from simulator.errors import InvalidInputError, Problem, RefusedError
from simulator.frames import Frames
from simulator.joint_scene import around, centre
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
        What is known of the scene. Of priors only the supports are used, and as where a fit over
        many frames begins to look. Of a joint law techniques of single frames take the numbers at
        its centre, and its spread is the part ``scene`` of every standard deviation.
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
    supposed = assumptions_of(scene, sensor, frames)
    against = contradiction(scene, sensor, frames)
    if against is not None:
        supposed = (against.said, *supposed)
    if techniques is None:
        if choice.chosen is None:
            advice: str | None = first_step(sensor, scene, frames, choice, None)
            return Estimates(None, (), choice.left_out, supposed, advice)
        result = _run(sensor, scene, frames, choice.chosen, against)
        if isinstance(result, LeftOut):
            advice = first_step(sensor, scene, frames, choice, result)
            return Estimates(None, (), (result, *choice.left_out), supposed, advice)
        bounds = result.range_bounds_m is not None
        advice = beyond_bounds(sensor, scene, frames, choice.chosen) if bounds else None
        return Estimates(choice.chosen, (result,), choice.left_out, supposed, advice)
    problems = [
        Problem(f"/techniques/{i}", f"{name!r} is not a technique")
        for i, name in enumerate(techniques)
        if name not in ALL_TECHNIQUES and name not in ELSEWHERE
    ]
    if problems:
        raise InvalidInputError(*problems)
    served: list[TechniqueResult] = []
    refused: LeftOut | None = None
    left_out = {item.name: item for item in choice.left_out if item.name not in techniques}
    if choice.chosen is not None and choice.chosen not in techniques:
        left_out[choice.chosen] = LeftOut(choice.chosen, "was not asked for")
    for name in dict.fromkeys(techniques):
        reason = ELSEWHERE.get(name)
        if reason is None:
            # a fit over many frames asks the frames alone
            of, stated = centre(sensor, scene) if name in TECHNIQUES else (sensor, scene)
            reason = obstacle(ALL_TECHNIQUES[name], of, stated, known_of(stated, of), frames)
        found = LeftOut(name, reason) if reason else _run(sensor, scene, frames, name, against)
        if isinstance(found, LeftOut):
            left_out[name] = found
            refused = found if reason is None else refused
        else:
            served.append(found)
    chosen = cheapest((result.technique for result in served), sensor, scene)
    todo = None if served else first_step(sensor, scene, frames, choice, refused)
    return Estimates(chosen, tuple(served), tuple(left_out.values()), supposed, todo)


def _run(
    sensor: Sensor, scene: Scene, frames: Frames, name: str, against: Contradiction | None
) -> TechniqueResult | LeftOut:
    start = time.perf_counter()
    try:
        result = solved_where_told(sensor, frames, lambda used: _solved(sensor, scene, used, name))
    except RefusedError as error:
        return LeftOut(name, str(error))
    if against is not None and _rests_on_numbers(name, scene):
        result = without_moved(result, _beside(sensor, scene, frames, name, against))
    return _taken(result, time.perf_counter() - start)


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
    of, stated = centre(sensor, scene) if name in TECHNIQUES else (sensor, scene)
    crosstalk = known_of(stated, of).crosstalk
    assert crosstalk is not None  # noqa: S101  # nothing contradicts what is unknown
    light = tuple(a + b for a, b in zip(crosstalk, against.light, strict=True))
    lit = stated.model_copy(update={"crosstalk": light})
    try:
        return solved_where_told(of, frames, lambda used: _solved(of, lit, used, name))
    except RefusedError:
        return None


def _taken(result: TechniqueResult, seconds: float) -> TechniqueResult:
    """As `dataclasses.replace`, which takes as long as many an estimate."""
    told = object.__new__(TechniqueResult)
    vars(told).update(vars(result), runtime_s=seconds)
    return told


def _solved(sensor: Sensor, scene: Scene, frames: Frames, name: str) -> TechniqueResult:
    solve = ALL_TECHNIQUES[name].solve
    if scene.joint is None or name not in TECHNIQUES:
        return solve(task_of(sensor, scene, frames, known_of(scene, sensor)))

    def at(of: Sensor, stated: Scene) -> TechniqueResult:
        known = known_of(stated, of)
        reason = obstacle(ALL_TECHNIQUES[name], of, stated, known, frames)
        if reason is not None:
            raise RefusedError(f"a standard deviation off the scene's centre it {reason}")
        return solve(task_of(of, stated, frames, known, physical=False))

    of, middle = centre(sensor, scene)
    result = solve(task_of(of, middle, frames, known_of(middle, of)))
    pairs = ((at(*plus), at(*minus)) for plus, minus in around(sensor, scene))
    return with_shared_error(result, pairs)


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
