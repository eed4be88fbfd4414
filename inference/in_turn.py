"""The techniques of one request in turn, the cheapest first: what is answered waits for no other.

Who may be out of time before the last has answered is told what has been answered so far.
"""

from collections.abc import Generator, Mapping, Sequence
from typing import NamedTuple, TypeVar

from inference.asked import Asked, Found, Turns, asked_of
from inference.assumptions import assumptions_of
from inference.estimates import Estimates, LeftOut, TechniqueResult
from inference.first_step import beyond_bounds
from inference.fits.answer.smoothed import SMOOTHED, smoothed
from inference.fits.techniques.registry import FITS
from inference.plan import Plan, cheapest
from inference.realtime.registry import TECHNIQUES
from inference.run import obstacle_by_prior
from inference.stated_light import StatedLight, answers, tells_more
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from simulator.errors import InvalidInputError, Problem
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["estimates_in_turn", "last_of"]

R = TypeVar("R")


def estimates_in_turn(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    choice: Plan,
    techniques: Sequence[str] | None = None,
    waiting: str | None = None,
) -> Generator[Estimates, None, Estimates]:
    """Estimate as `inference.estimate.estimate_planned` does, technique by technique.

    Parameters
    ----------
    sensor, scene, frames, choice, techniques
        As for `inference.estimate.estimate_planned`.
    waiting : str, optional
        What is to be said of techniques that have not answered yet.

    Yields
    ------
    Estimates
        With ``waiting``, before a technique is asked, where another has a result: all that is known
        by then. Those that have not answered yet are left out with that reason. When the choice
        was not named, the techniques that may go before it are asked first where it is a fit over
        many frames.

    Returns
    -------
    Estimates
        All of it.

    Raises
    ------
    InvalidInputError
        As of `inference.estimate.estimate`.
    """
    asked = asked_of(sensor, scene, frames)
    supposed = assumptions_of(scene, sensor, frames)
    if techniques is None:
        turns = _chosen(asked, choice, waiting)
    else:
        turns = _named(asked, choice, techniques, waiting)
    while True:
        try:
            so_far = next(turns)
        except StopIteration as end:
            return _told(asked, supposed, end.value)
        yield _told(asked, supposed, so_far)


def last_of(turns: Generator[object, None, R]) -> R:
    """Return what a generator returns.

    Parameters
    ----------
    turns : generator
        What it yields is not looked at.
    """
    while True:
        try:
            next(turns)
        except StopIteration as end:
            outcome: R = end.value
            return outcome


def _told(asked: Asked, supposed: tuple[str, ...], found: Found) -> Estimates:
    """Say what the results suppose, and what empty frames have against it."""
    resting = any(asked.rests_on_prior(each.technique) for each in found.results)
    if asked.against is not None and (asked.light is None or resting):
        supposed = (asked.against.said, *supposed)
    if any(smoothed(each.fit) for each in found.results):
        supposed = (*supposed, SMOOTHED)
    return Estimates(found.chosen, found.results, found.left_out, supposed, found.do_first)


def _chosen(asked: Asked, choice: Plan, waiting: str | None) -> Turns:
    """Answer by the technique that tells most, of all that the scene allows."""
    name = choice.chosen
    beside = None if asked.light is None else _beside(asked, asked.light)
    first = beside is not None and isinstance(beside.found, TechniqueResult)
    if first and waiting is not None and name is not None and name in FITS:
        yield _decided(asked, choice, beside, LeftOut(name, waiting))
    planned = None if name is None else asked.run(name)
    return _decided(asked, choice, beside, planned)


class _Beside(NamedTuple):
    """What goes beside the plan's choice by a prior of the crosstalk."""

    reasons: dict[str, str | None]  # against each technique that rests on it
    name: str | None  # of the cheapest without one
    found: TechniqueResult | LeftOut | None  # its answer


def _beside(asked: Asked, light: StatedLight) -> _Beside:
    """Ask the cheapest technique that rests on the prior of the crosstalk."""
    names = filter(asked.rests_on_prior, TECHNIQUES)
    reasons = {name: obstacle_by_prior(light, asked.frames, name) for name in names}
    able = [name for name, reason in reasons.items() if reason is None]
    name = cheapest(able, asked.sensor, asked.scene)
    return _Beside(reasons, name, None if name is None else asked.run(name))


def _decided(
    asked: Asked,
    choice: Plan,
    beside: _Beside | None,
    planned: TechniqueResult | LeftOut | None,
) -> Found:
    """Answer by the plan's choice, or by what goes before it."""
    left_out = choice.left_out
    if isinstance(planned, LeftOut):
        left_out = (planned, *left_out)
    if beside is not None:
        found, left_out = _before(beside, planned, left_out)
        if found is not None:
            return Found(found.technique, (found,), left_out)
    if not isinstance(planned, TechniqueResult):
        return Found(None, (), left_out, asked.first_step(choice, planned))
    todo = None
    if planned.range_bounds_m is not None:
        todo = beyond_bounds(asked.sensor, asked.scene, asked.frames, planned.technique)
    return Found(planned.technique, (planned,), left_out, todo)


def _before(
    beside: _Beside,
    planned: TechniqueResult | LeftOut | None,
    left_out: tuple[LeftOut, ...],
) -> tuple[TechniqueResult | None, tuple[LeftOut, ...]]:
    """Return what goes before the plan's choice, and what is left."""
    found = beside.found
    served = f"{beside.name} serves the scene at less cost"
    if isinstance(found, LeftOut):
        served = found.reason
    told = {item.name: item for item in left_out}
    told |= {other: LeftOut(other, reason or served) for other, reason in beside.reasons.items()}
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


def _named(asked: Asked, choice: Plan, techniques: Sequence[str], waiting: str | None) -> Turns:
    """Answer by the techniques that are asked for."""
    problems = [
        Problem(f"/techniques/{i}", f"{name!r} is not a technique")
        for i, name in enumerate(techniques)
        if name not in ALL_TECHNIQUES and name not in ELSEWHERE
    ]
    if problems:
        raise InvalidInputError(*problems)
    obstacles = {name: asked.obstacle(name) for name in techniques}
    said: dict[str, TechniqueResult | LeftOut] = {
        name: LeftOut(name, reason or waiting or "") for name, reason in obstacles.items()
    }
    able = [name for name, reason in obstacles.items() if reason is None]
    for name in sorted(able, key=lambda name: ALL_TECHNIQUES[name].cost):
        if waiting is not None and any(isinstance(each, TechniqueResult) for each in said.values()):
            yield _gathered(asked, choice, said, able)
        said[name] = asked.run(name)
    return _gathered(asked, choice, said, able)


def _gathered(
    asked: Asked,
    choice: Plan,
    said: Mapping[str, TechniqueResult | LeftOut],
    able: Sequence[str],
) -> Found:
    """Return what the techniques that are asked for have said, in the order of their names."""
    sensor, scene = asked.sensor, asked.scene
    served: dict[str, TechniqueResult] = {}
    refused: LeftOut | None = None
    left_out = {item.name: item for item in choice.left_out if item.name not in said}
    if choice.chosen is not None and choice.chosen not in said:
        left_out[choice.chosen] = LeftOut(choice.chosen, "was not asked for")
    for name, found in said.items():
        if isinstance(found, LeftOut):
            left_out[name] = found
            own = name in able and not asked.rests_on_prior(name)
            refused = found if own else refused
        else:
            served[name] = found
    chosen = cheapest((name for name in served if not asked.rests_on_prior(name)), sensor, scene)
    other = cheapest(filter(asked.rests_on_prior, served), sensor, scene)
    if other is not None and (chosen is None or tells_more(served[other], served[chosen])):
        chosen = other
    todo = None if served else asked.first_step(choice, refused)
    return Found(chosen, tuple(served.values()), tuple(left_out.values()), todo)
