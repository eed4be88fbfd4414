"""Estimates at once: readings in, all physical ranges out, at once."""

from collections.abc import Sequence
from typing import NamedTuple

from inference.assumptions import assumptions_of
from inference.empty_frames import Contradiction, contradiction
from inference.estimates import Estimates, LeftOut, TechniqueResult
from inference.first_step import beyond_bounds, first_step
from inference.known import known_of
from inference.plan import Plan, cheapest, obstacle, plan
from inference.realtime.registry import TECHNIQUES
from inference.run import Said, by_prior, obstacle_by_prior, run
from inference.stated_light import StatedLight, answers, stated_light, tells_more
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from inference.temperature import solved_where_told, task_of
from simulator.errors import InvalidInputError, Problem
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
    light = stated_light(sensor, scene)
    numbers, open_ = (scene, None) if light is None else (light.scene, light.sd)
    against = contradiction(numbers, sensor, frames, open_)
    asked = _Asked(sensor, scene, frames, light, against, {})
    supposed = assumptions_of(scene, sensor, frames)
    found = _chosen(asked, choice) if techniques is None else _named(asked, choice, techniques)
    resting = any(asked.rests_on_prior(each.technique) for each in found.results)
    if against is not None and (light is None or resting):
        supposed = (against.said, *supposed)
    return Estimates(found.chosen, found.results, found.left_out, supposed, found.do_first)


class _Asked(NamedTuple):
    """A request, and what is found out of it once."""

    sensor: Sensor
    scene: Scene
    frames: Frames
    light: StatedLight | None  # where the crosstalk has priors
    against: Contradiction | None
    said: Said

    def rests_on_prior(self, name: str) -> bool:
        """Tell whether a technique needs the crosstalk, of which there is a prior."""
        own = TECHNIQUES.get(name)
        return self.light is not None and own is not None and "crosstalk" not in own.immune_to

    def run(self, name: str) -> TechniqueResult | LeftOut:
        """Ask a technique that serves the scene."""
        if self.light is not None and self.rests_on_prior(name):
            return by_prior(self.sensor, self.light, self.frames, name, self.against)
        against = None if self.light is not None else self.against
        return run(self.sensor, self.scene, self.frames, name, against, self.said)

    def first_step(self, choice: Plan, refused: LeftOut | None) -> str:
        """Return what to do first where nothing answers."""
        return first_step(self.sensor, self.scene, self.frames, choice, refused)


class _Found(NamedTuple):
    """Results, and why there are no others; see `Estimates`."""

    chosen: str | None
    results: tuple[TechniqueResult, ...]
    left_out: tuple[LeftOut, ...]
    do_first: str | None = None


def _chosen(asked: _Asked, choice: Plan) -> _Found:
    """Answer by the technique that tells most, of all that the scene allows."""
    planned = None if choice.chosen is None else asked.run(choice.chosen)
    left_out = choice.left_out
    if isinstance(planned, LeftOut):
        left_out = (planned, *left_out)
    if asked.light is not None:
        found, left_out = _beside(asked, asked.light, planned, left_out)
        if found is not None:
            return _Found(found.technique, (found,), left_out)
    if not isinstance(planned, TechniqueResult):
        return _Found(None, (), left_out, asked.first_step(choice, planned))
    todo = None
    if planned.range_bounds_m is not None:
        todo = beyond_bounds(asked.sensor, asked.scene, asked.frames, planned.technique)
    return _Found(planned.technique, (planned,), left_out, todo)


def _beside(
    asked: _Asked,
    light: StatedLight,
    planned: TechniqueResult | LeftOut | None,
    left_out: tuple[LeftOut, ...],
) -> tuple[TechniqueResult | None, tuple[LeftOut, ...]]:
    """Return what goes before the plan's choice by a prior of the crosstalk, and what is left."""
    names = filter(asked.rests_on_prior, TECHNIQUES)
    reasons = {name: obstacle_by_prior(light, asked.frames, name) for name in names}
    able = [name for name, reason in reasons.items() if reason is None]
    name = cheapest(able, asked.sensor, asked.scene)
    found = None if name is None else asked.run(name)
    served = f"{name} serves the scene at less cost"
    if isinstance(found, LeftOut):
        served = found.reason
    told = {item.name: item for item in left_out}
    told |= {other: LeftOut(other, reason or served) for other, reason in reasons.items()}
    if isinstance(found, TechniqueResult):
        if not isinstance(planned, TechniqueResult):
            del told[found.technique]
            return found, tuple(told.values())
        first = tells_more(found, planned)
        more, less = (found, planned) if first else (planned, found)
        told.pop(more.technique, None)
        told[less.technique] = LeftOut(less.technique, _tells_less(more))
        return (found if first else None), tuple(told.values())
    return None, tuple(told.values())


def _tells_less(than: TechniqueResult) -> str:
    return (
        f"{than.technique} tells more of these frames, or the same sharper: "
        f"{int(answers(than).sum())} of {len(than)}"
    )


def _named(asked: _Asked, choice: Plan, techniques: Sequence[str]) -> _Found:
    """Answer by the techniques that are asked for."""
    sensor, scene, frames = asked.sensor, asked.scene, asked.frames
    problems = [
        Problem(f"/techniques/{i}", f"{name!r} is not a technique")
        for i, name in enumerate(techniques)
        if name not in ALL_TECHNIQUES and name not in ELSEWHERE
    ]
    if problems:
        raise InvalidInputError(*problems)
    served: dict[str, TechniqueResult] = {}
    refused: LeftOut | None = None
    left_out = {item.name: item for item in choice.left_out if item.name not in techniques}
    if choice.chosen is not None and choice.chosen not in techniques:
        left_out[choice.chosen] = LeftOut(choice.chosen, "was not asked for")
    for name in dict.fromkeys(techniques):
        reason = ELSEWHERE.get(name)
        if reason is None and not asked.rests_on_prior(name):
            # a fit over many frames asks the frames alone
            of, stated = centre(sensor, scene) if name in TECHNIQUES else (sensor, scene)
            reason = obstacle(ALL_TECHNIQUES[name], of, stated, known_of(stated, of), frames)
        found = LeftOut(name, reason) if reason else asked.run(name)
        if isinstance(found, LeftOut):
            left_out[name] = found
            own = reason is None and not asked.rests_on_prior(name)
            refused = found if own else refused
        else:
            served[name] = found
    chosen = cheapest((name for name in served if not asked.rests_on_prior(name)), sensor, scene)
    other = cheapest(filter(asked.rests_on_prior, served), sensor, scene)
    if other is not None and (chosen is None or tells_more(served[other], served[chosen])):
        chosen = other
    todo = None if served else asked.first_step(choice, refused)
    return _Found(chosen, tuple(served.values()), tuple(left_out.values()), todo)


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
