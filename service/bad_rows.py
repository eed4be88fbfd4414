"""Frames that could not be read: each has an answer that says why, and the others keep theirs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from service.frame_table import BadRow
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["answer_of", "insert_answers", "with_saturated_rows"]

# the largest number that a sensor may state: no reading comes near it
_NEVER = 1e50


def answer_of(row: BadRow) -> dict[str, Any]:
    """Return the estimate of a frame that could not be read."""
    empty: dict[str, Any] = {"status": "none", "range_m": None, "sd_m": None}
    return empty | {"roots_m": [], "roots_sd_m": [], "near_fold": False, "reason": str(row)}


def insert_answers(document: dict[str, Any], bad: Sequence[BadRow]) -> None:
    """Put the answers of bad rows where they belong.

    Parameters
    ----------
    document : dict
        Estimates of the good rows, as JSON data; changed in place.
    bad : sequence of BadRow
        In their order.
    """
    for result in document["results"]:
        for row in bad:
            result["frames"].insert(row.index, answer_of(row))


def with_saturated_rows(
    sensor: Sensor, frames: Frames, bad: Sequence[BadRow]
) -> tuple[Sensor, Frames]:
    """Count bad rows as saturated frames, of which nothing is used and which keep their numbers.

    Parameters
    ----------
    sensor : Sensor
        As stated.
    frames : Frames
        The good rows.
    bad : sequence of BadRow
        The others, in their order.

    Returns
    -------
    (Sensor, Frames)
        The sensor with a full scale, one that no reading reaches where it has none; and as many
        frames as there are rows.
    """
    if not bad:
        return sensor, frames
    limit = sensor.full_scale or (_NEVER, _NEVER)
    # every frame first stands for itself, every bad row for a neighbour
    total = len(frames) + len(bad)
    lost = np.zeros(total, dtype=bool)
    lost[[row.index for row in bad]] = True
    whole = frames.select(np.maximum(np.cumsum(~lost) - 1, 0))
    whole.readings[lost] = limit
    return sensor.model_copy(update={"full_scale": limit}), whole
