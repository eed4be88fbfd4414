"""What answers of a stream suppose, and what looks like a mistake: each told once a stream."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from inference.assumptions import unused_temperature
from inference.smoothed_readings import smoothed_readings
from service.plausibility import LOOKED, noise_doubts, time_doubts
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["More", "Supposing", "told_with"]

More = Sequence[dict[str, Any] | None] | None


class Supposing(NamedTuple):
    """What of it was told.

    Attributes
    ----------
    supposed : bool
        Whether a temperature that nothing uses was.
    early : sequence of sequences of float, or None
        Readings and times of the first frames, until there are enough to look at their noise and
        their steps; then None, and nothing is looked at any more.
    """

    supposed: bool
    early: Sequence[Sequence[float]] | None


def told_with(
    before: Supposing, sensor: Sensor, frames: Frames, also: More
) -> tuple[Supposing, More]:
    """Tell what is to be told with frames: of an unused temperature the first frame that has one.

    Of noise and times it is the last of the first `LOOKED` frames, however a stream is cut.

    Parameters
    ----------
    before : Supposing
        What was told.
    sensor, frames : Sensor, Frames
        The next frames of a stream, n of them.
    also : sequence of n dict or None, or None
        What else is said of them.

    Returns
    -------
    (Supposing, sequence of n dict or None, or None)
        What is told now, and what is said of the frames with it.
    """
    supposed, early = before
    told: list[tuple[int, str]] = []
    if not supposed and (unused := unused_temperature(sensor, frames)):
        supposed = True
        told.append(unused)
    if early is not None:
        room = LOOKED - len(early)
        early = [*early, *_rows(frames, room)]
        if len(early) == LOOKED:
            told += [(room - 1, doubt) for doubt in _doubts(sensor, early)]
            early = None
    if not told:
        return Supposing(supposed, early), also
    more = list(also or [None] * len(frames))
    for at, reason in told:
        said = more[at] or {}
        more[at] = said | {"assumptions": [*said.get("assumptions", ()), reason]}
    return Supposing(supposed, early), more


def _rows(frames: Frames, count: int) -> Sequence[Sequence[float]]:
    """Return the readings and, where there is one, the time of the first frames."""
    columns = (frames.readings,) if frames.time_s is None else (frames.readings, frames.time_s)
    rows: list[list[float]] = np.column_stack(columns)[:count].tolist()
    return rows


def _doubts(sensor: Sensor, early: Sequence[Sequence[float]]) -> Iterator[str]:
    """Yield what looks like a mistake."""
    rows = np.array(early)
    yield from noise_doubts(sensor, rows[:, :2])
    if doubt := smoothed_readings(sensor, Frames(rows[:, :2])):
        yield doubt
    yield from time_doubts(rows[:, 2:].ravel())
