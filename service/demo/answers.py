"""Answers of the service beside the truth, however they were found."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

__all__ = ["Answer", "Episode", "Point", "of_estimates", "of_posterior"]

_Z90 = 1.6448536269514722  # half width of a normal 90 % interval in standard deviations


@dataclasses.dataclass(frozen=True)
class Point:
    """One frame.

    Attributes
    ----------
    truth_m : float
        True range [m].
    range_m, low_m, high_m : float
        The answer and its 90 % interval [m]; nan where there is no single one.
    status : str
        As the service says.
    roots : tuple of (float, float)
        Ranges that explain the frame [m] with their weights; equal weights where none are known.
    """

    truth_m: float
    range_m: float
    low_m: float
    high_m: float
    status: str
    roots: tuple[tuple[float, float], ...]


@dataclasses.dataclass(frozen=True)
class Answer:
    """One way to answer, for all frames.

    Attributes
    ----------
    name : str
        Technique, or posterior.
    points : tuple of Point
        One a frame.
    remark : str
        For a person.
    misfit : bool
        Whether the service says that its model cannot make such readings.
    """

    name: str
    points: tuple[Point, ...]
    remark: str = ""
    misfit: bool = False


@dataclasses.dataclass(frozen=True)
class Episode:
    """One scene with its answers."""

    title: str
    source: str
    answers: tuple[Answer, ...]


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def of_estimates(name: str, truth_m: Sequence[float], frames: Sequence[dict[str, Any]]) -> Answer:
    """Read the frames of one technique's result."""
    points = []
    for truth, frame in zip(truth_m, frames, strict=True):
        middle, half = _number(frame["range_m"]), _Z90 * _number(frame["sd_m"])
        roots = tuple((root, 1 / len(frame["roots_m"])) for root in frame["roots_m"])
        status = frame["status"]
        # there is no range below zero, however wide a normal interval is
        low = max(middle - half, 0.0) if math.isfinite(half) else math.nan
        points.append(Point(truth, middle, low, middle + half, status, roots))
    return Answer(name, tuple(points))


def of_posterior(name: str, truth_m: Sequence[float], posterior: dict[str, Any]) -> Answer:
    """Read a posterior: medians, 90 % intervals, modes; several modes are ambiguous.

    Frames after those of which the truth is given, such as empty ones, are left out.
    """
    ranges = posterior["range_m"]
    points = []
    for index, truth in enumerate(truth_m):
        modes = tuple((mode["range_m"], mode["weight"]) for mode in ranges["modes"][index])
        status = ("none", "unique", "ambiguous")[min(len(modes), 2)]
        if status == "unique" and ranges["near_fold"][index]:
            status = "near fold"
        middle, low, high = (_number(ranges[key][index]) for key in ("q50", "q05", "q95"))
        points.append(Point(truth, middle, low, high, status, modes))
    verdict, fit = posterior["verdict"], posterior["fit"]
    words = ["converged" if verdict["converged"] else "; ".join(verdict["reasons"])]
    if fit["misfit"]:
        words.append("MISFIT, do not trust the intervals: " + "; ".join(fit["reasons"]))
    words += [
        f"{row['parameter']} is {row['status'].replace('_', ' ')}"
        for row in posterior["identifiability"]
        if row["status"] != "identified"
    ]
    words.append(f"{posterior['runtime']['wall_s']:.1f} s")
    return Answer(name, tuple(points), ", ".join(words), fit["misfit"])
