"""The search for optima, before anything is drawn: ways that know nothing of one another.

Each is a task of its own: as many processes as there are ways look at once. Where sampling begins
with a shape, the best of what all of them found are climbed on from side by side.
"""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np

from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Job
from inference.posterior.sampling.scouts import led_to, send_scouts, thinned
from inference.posterior.sampling.start import Optimum, find_optima, roughly
from inference.posterior.stages.chunk import is_short_for_scouts
from inference.posterior.stages.setting_out import HALFWAY
from inference.posterior.stages.shaping import (
    CLIMBED,
    begins_with_a_shape,
    climbed_from,
    with_ends,
)
from inference.posterior.stages.stage import Starting
from inference.posterior.streams import Stream

__all__ = ["LookTask", "Looked", "ShapeTask", "looking", "of_some_frames", "taken_in", "ways_left"]

Way = Literal["fitted", "climbed", "scouts"]

_WAYS: tuple[Way, ...] = ("scouts", "fitted", "climbed")  # the longest first

_SOME = (250, 50)  # frames at most that may hold the object, and that do not


@dataclasses.dataclass(frozen=True, eq=False)
class Looked:
    """What one way led to.

    Attributes
    ----------
    start : Starting
        With that alone.
    calls : int
        Density evaluations that were counted.
    """

    start: Starting
    calls: int


@dataclasses.dataclass(frozen=True, eq=False)
class LookTask:
    """One way of looking for optima in the scene that was chosen.

    Attributes
    ----------
    job : Job
        Without optional terms, and with something unknown.
    way : str
        Which member of `Starting` is looked for.
    brief : bool
        Whether what is found is climbed on from with the model's errors, in coordinates of its own:
        rough shapes do, and scouts that stop on their way.
    """

    job: Job
    way: Way
    brief: bool = False

    def run(self) -> Looked:
        """Look."""
        job = of_some_frames(self.job) if self.job.is_large else self.job
        density = job.density()
        if self.way == "fitted":
            return Looked(Starting(fitted=tuple(fitted_optima(job, density, brief=self.brief))), 0)
        if self.way == "climbed":
            found = find_optima(density, self.job.stream(Stream.SCREEN), brief=self.brief)
            return Looked(Starting(climbed=tuple(found)), 0)
        reach = HALFWAY if self.brief else 1.0
        scouts, calls = send_scouts(thinned(density), self.job.stream(Stream.SCOUTS), reach)
        ends = led_to(scouts, density, (), roughly) if self.brief else ()
        return Looked(Starting(scouts=scouts, ends=tuple(ends)), calls)


@dataclasses.dataclass(frozen=True, eq=False)
class ShapeTask:
    """A shape to be climbed to.

    Attributes
    ----------
    job : Job
        That begins with a shape.
    optima : tuple of Optimum
        All that were found.
    rank : int
        Which of them it is climbed to from: 0 from the best with the model's errors.
    """

    job: Job
    optima: tuple[Optimum, ...]
    rank: int

    def run(self) -> Looked:
        """Climb."""
        shape = climbed_from(self.job, self.job.density(), self.optima, self.rank)
        return Looked(Starting(shapes=() if shape is None else (shape,)), 0)


def ways_left(start: Starting, *, scouts: bool) -> tuple[Way, ...]:
    """Return the ways that are left; scouts are not sent out while terms are being decided."""
    ways = _WAYS if scouts else _WAYS[1:]
    return tuple(way for way in ways if getattr(start, way) is None)


def looking(job: Job, start: Starting, *, scouts: bool) -> tuple[LookTask | ShapeTask, ...]:
    """Return a task for each of the ways that are left; scouts set out last where time is short.

    Shapes are climbed to from what all of them found.
    """
    ways = ways_left(start, scouts=scouts)
    brief = scouts and begins_with_a_shape(job, job.density())
    if len(ways) > 1 and is_short_for_scouts(job):
        ways = tuple(way for way in ways if way != "scouts")
    if ways or not brief or start.shapes is not None:
        return tuple(LookTask(job, way, brief) for way in ways)
    optima = tuple(with_ends(start))
    return tuple(ShapeTask(job, optima, rank) for rank in range(min(CLIMBED, len(optima))))


def taken_in(start: Starting, found: Sequence[Looked]) -> tuple[Starting, int]:
    """Return all that is known then, and the density evaluations on the way to it."""
    for each in found:
        new = {way: getattr(each.start, way) for way in _WAYS}
        changes = {way: value for way, value in new.items() if value is not None}
        start = dataclasses.replace(start, **changes, ends=start.ends + each.start.ends)
        if each.start.shapes is not None:
            shapes = (*(start.shapes or ()), *each.start.shapes)
            start = dataclasses.replace(start, shapes=shapes)
    return start, sum(each.calls for each in found)


def of_some_frames(job: Job) -> Job:
    """Return the job of so few frames that every branch is seen, with and without object."""
    rng, usable = job.stream(Stream.REPRESENTATIVES, 0), np.flatnonzero(job.usable)
    present = job.frames.object_present
    holds = np.ones(len(usable), dtype=bool) if present is None else present[usable]
    kinds = zip((holds, ~holds), _SOME, strict=True)
    some = [rng.permutation(usable[flag])[:most] for flag, most in kinds]
    return job.part(np.sort(np.concatenate(some)))
