"""The search for optima, before anything is drawn: ways that know nothing of one another.

Each is a task of its own: as many processes as there are ways look at once.
"""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np

from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Job
from inference.posterior.sampling.scouts import send_scouts, thinned
from inference.posterior.sampling.start import find_optima, refine, roughly
from inference.posterior.stages.chunk import is_short_for_scouts
from inference.posterior.stages.shaping import begins_with_a_shape
from inference.posterior.stages.stage import Starting
from inference.posterior.streams import Stream

__all__ = ["LookTask", "Looked", "looking", "of_some_frames", "taken_in", "ways_left"]

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
        Whether what is found is climbed on from, in coordinates of its own: rough shapes do.
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
            finish = roughly if self.brief else refine
            found = find_optima(density, self.job.stream(Stream.SCREEN), finish)
            return Looked(Starting(climbed=tuple(found)), 0)
        scouts, calls = send_scouts(thinned(density), self.job.stream(Stream.SCOUTS))
        return Looked(Starting(scouts=scouts), calls)


def ways_left(start: Starting, *, scouts: bool) -> tuple[Way, ...]:
    """Return the ways that are left; scouts are not sent out while terms are being decided."""
    ways = _WAYS if scouts else _WAYS[1:]
    return tuple(way for way in ways if getattr(start, way) is None)


def looking(job: Job, start: Starting, *, scouts: bool) -> tuple[LookTask, ...]:
    """Return a task for each of the ways that are left; scouts set out last where time is short."""
    ways = ways_left(start, scouts=scouts)
    if len(ways) > 1 and is_short_for_scouts(job):
        ways = tuple(way for way in ways if way != "scouts")
    brief = scouts and begins_with_a_shape(job, job.density())
    return tuple(LookTask(job, way, brief) for way in ways)


def taken_in(start: Starting, found: Sequence[Looked]) -> tuple[Starting, int]:
    """Return all that is known then, and the density evaluations on the way to it."""
    for each in found:
        new = {way: getattr(each.start, way) for way in _WAYS}
        changes = {way: value for way, value in new.items() if value is not None}
        start = dataclasses.replace(start, **changes)
    return start, sum(each.calls for each in found)


def of_some_frames(job: Job) -> Job:
    """Return the job of so few frames that every branch is seen, with and without object."""
    rng, usable = job.stream(Stream.REPRESENTATIVES, 0), np.flatnonzero(job.usable)
    present = job.frames.object_present
    holds = np.ones(len(usable), dtype=bool) if present is None else present[usable]
    kinds = zip((holds, ~holds), _SOME, strict=True)
    some = [rng.permutation(usable[flag])[:most] for flag, most in kinds]
    return job.part(np.sort(np.concatenate(some)))
