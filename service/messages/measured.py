"""What one frame says, as messages of other systems can carry it: one range, or none."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from inference.estimates import Status, TechniqueResult
from inference.known import Known
from inference.realtime.turns import several_turns
from inference.technique import Technique
from simulator.sensor import Sensor

__all__ = ["SIDES", "Limits", "Measured", "limits_of", "measured_of", "total"]

Side = Literal["near", "far"]
Limits = tuple[float, float]

SIDES: Mapping[str, Side] = {
    "the scene holds no object": "far",
    "no light: w2 is not positive": "far",
    "no signal: i and q are zero": "far",
    "no light from the object: the reading is not positive": "far",
    "w1 is above w2: beyond r0, or too little light": "far",
    "the late window reads less than from an object at r0": "far",
    "the readings lie at or beyond the background": "far",
    "w1 is not positive: at or near contact": "near",
    "the phase is below zero within its noise: at or near contact": "near",
    "the derivatives point below zero range within their noise: at or near contact": "near",
}
"""Reasons that say on which side of what can be measured an object is, or that there is none."""


@dataclasses.dataclass(frozen=True, slots=True)
class Measured:
    """One frame's answer.

    Attributes
    ----------
    status : str
        Name of a `Status` in small letters.
    range_m : float or None
        The range, where it is the only one [m].
    variance_m2 : float or None
        Of everything that is possible together, noise, scene and model, and the distance between
        ranges where there are several [m^2]; None where it is not known.
    side : "near", "far" or None
        Of what can be measured, where there is no range and the reason tells.
    certain : bool
        Whether the range is the only one and its error is known: what a message may call valid.
    time_s : float or None
        Of the frame [s].
    limits_m : (float, float)
        Between which answers lie [m]; the second may be infinite.
    """

    status: str
    range_m: float | None
    variance_m2: float | None
    side: Side | None
    certain: bool
    time_s: float | None
    limits_m: Limits


def total(ranges_m: Sequence[float], sds_m: Sequence[float]) -> float | None:
    """Return the variance of ranges of equal weight: the mean of theirs, and that between [m^2].

    Parameters
    ----------
    ranges_m, sds_m : sequence of float
        The ranges, and their standard deviations, nan where one is not known [m].

    Returns
    -------
    float or None
        None without a range, or where a standard deviation is not known.
    """
    if not ranges_m or not all(map(math.isfinite, sds_m)):
        return None
    return float(np.mean(np.square(sds_m)) + np.var(ranges_m))


def limits_of(technique: Technique, sensor: Sensor, known: Known) -> Limits:
    """Return between which ranges a technique answers [m].

    Parameters
    ----------
    technique : Technique
        Of single frames.
    sensor : Sensor
        Where it wraps, or has no late light.
    known : Known
        Of the scene: where its ranges are, and its background.
    """
    low, high = known.support
    turn = technique.farthest_m(sensor)
    end = known.stated_end_m
    if end is not None and several_turns(sensor, known, turn):
        turn = end
    high = min(high, turn)
    if technique.uses_background and known.has("background.distance_m"):
        high = min(high, known.get("background.distance_m"))
    return low, high


def measured_of(
    result: TechniqueResult, time_s: Sequence[float] | None, limits_m: Limits
) -> list[Measured]:
    """Return the answers of a technique, frame by frame.

    Ranges of an ambiguous frame have equal weights: a technique knows of none that is likelier.

    Parameters
    ----------
    result : TechniqueResult
        For n frames.
    time_s : sequence of float, shape (n,), optional
        Times of the frames [s].
    limits_m : (float, float)
        As of `limits_of`.
    """
    found = []
    for n, status in enumerate(result.status.tolist()):
        count = int(result.root_count[n])
        roots, sds = result.roots_m[n, :count].tolist(), result.roots_sd_m[n, :count].tolist()
        unique = status == Status.UNIQUE
        variance = total(roots, sds)
        found.append(
            Measured(
                status=Status(status).name.lower(),
                range_m=roots[0] if unique else None,
                variance_m2=variance,
                side=SIDES.get(result.reasons[result.reason[n]]) if not count else None,
                certain=unique and variance is not None and not result.near_fold[n],
                time_s=None if time_s is None else float(time_s[n]),
                limits_m=limits_m,
            )
        )
    return found
