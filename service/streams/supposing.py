"""What answers of a stream suppose, and what looks like a mistake: each told once a stream."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from inference.assumptions import unused_temperature
from service.plausibility import LOOKED, noise_doubts
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
    early : sequence of pairs of float, or None
        Readings of the first frames, until there are enough to look at their noise; then None, and
        nothing is looked at any more.
    """

    supposed: bool
    early: Sequence[Sequence[float]] | None


def told_with(
    before: Supposing, sensor: Sensor, frames: Frames, also: More
) -> tuple[Supposing, More]:
    """Tell what is to be told with frames: of an unused temperature the first frame that has one.

    Of noise it is the last of the first `LOOKED` frames, however a stream is cut.

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
        early = [*early, *frames.readings[:room].tolist()]
        if len(early) == LOOKED:
            told += [(room - 1, doubt) for doubt in noise_doubts(sensor, np.array(early))]
            early = None
    if not told:
        return Supposing(supposed, early), also
    more = list(also or [None] * len(frames))
    for at, reason in told:
        said = more[at] or {}
        more[at] = said | {"assumptions": [*said.get("assumptions", ()), reason]}
    return Supposing(supposed, early), more
