"""What frames know of their ranges beside their readings, and what can be no such knowledge."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulator.errors import Problem

__all__ = ["MAY_BE_NULL", "known_range_problems", "telling"]

Array = NDArray[np.float64]

_KNOWN = ("known_range_m", "known_range_sd_m")
_MOVED = ("displacement_m", "displacement_sd_m")
MAY_BE_NULL = (*_KNOWN, *_MOVED, "temperature_k")
"""Columns whose entries may be null, which as numbers are nan: there nothing is known."""

# false alarms of ranges and displacements that agree: one set of frames in a billion
_CONTRADICTED = 1e-9


def known_range_problems(columns: Mapping[str, NDArray[Any]], max_range_m: float) -> list[Problem]:
    """Find what cannot be known of ranges.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (n,)
        The columns of frames that are given, of equal length, nan for null.
    max_range_m : float
        Largest range that the sensor tells apart [m].

    Returns
    -------
    list of Problem
        For each column its first bad entry.
    """
    if columns.keys().isdisjoint((*_KNOWN, *_MOVED)):
        return []
    problems = [
        Problem(f"/{name}", f"is missing, and {other} is given")
        for pair in (_KNOWN, _MOVED)
        for name, other in (pair, pair[::-1])
        if other in columns and name not in columns
    ]
    if problems:
        return problems
    for value, sd in (_KNOWN, _MOVED):
        if value in columns:
            problems += _loose(columns[value], columns[sd], sd)
    if _KNOWN[0] in columns:
        problems += _impossible(columns[_KNOWN[0]], max_range_m)
    for value, _ in (_KNOWN, _MOVED):
        if value in columns and "object_present" in columns and not problems:
            problems += _of_nothing(columns[value], columns["object_present"], value)
    if _MOVED[0] in columns and not problems:
        problems += _unmoved(columns, max_range_m)
    return problems


def telling(columns: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
    """Return those of the columns that tell anything: one of nulls is as good as none."""
    return {
        name: columns[name]
        for pair in (_KNOWN, _MOVED)
        if pair[0] in columns and np.isfinite(columns[pair[0]]).any()
        for name in pair
    }


def _loose(value: Array, sd: Array, name: str) -> list[Problem]:
    """Find what is said to be known without a standard deviation."""
    with np.errstate(invalid="ignore"):
        loose = np.flatnonzero(np.isfinite(value) & ~(sd > 0))
    if not loose.size:
        return []
    said = "is null" if np.isnan(sd[loose[0]]) else f"is {sd[loose[0]]:g}"
    text = f"entry {loose[0]} {said}, and must be above 0 where something is known"
    return [Problem(f"/{name}", f"{text}: what is known nearly exactly has a small one")]


def _impossible(value: Array, max_range_m: float) -> list[Problem]:
    """Find known ranges that no frame can have."""
    with np.errstate(invalid="ignore"):
        out = np.flatnonzero(np.isfinite(value) & ~((value > 0) & (value <= max_range_m)))
    if not out.size:
        return []
    said = f"entry {out[0]} is {value[out[0]]:g} m, and the sensor tells ranges from 0 to "
    return [Problem(f"/{_KNOWN[0]}", f"{said}{max_range_m:.4g} m")]


def _of_nothing(value: Array, present: NDArray[np.bool_], name: str) -> list[Problem]:
    """Find what is known of an object in frames that hold none."""
    empty = np.flatnonzero(np.isfinite(value) & ~present)
    if not empty.size:
        return []
    said = f"entry {empty[0]} must be null: the frame holds no object whose range it could be"
    return [Problem(f"/{name}", said)]


def _unmoved(columns: Mapping[str, NDArray[Any]], max_range_m: float) -> list[Problem]:
    """Find displacements that no ranges have, or none that are known."""
    moved, moved_sd = (columns[name] for name in _MOVED)
    pointer, told = f"/{_MOVED[0]}", moved[np.isfinite(moved)]
    if told.size and np.ptp(told) >= max_range_m:
        said = f"spans {np.ptp(told):.4g} m, and the sensor tells ranges from 0 to "
        return [Problem(pointer, f"{said}{max_range_m:.4g} m")]
    if _KNOWN[0] not in columns:
        return []
    from scipy.special import chdtrc  # late: few frames know this much

    known, known_sd = (columns[name] for name in _KNOWN)
    both = np.flatnonzero(np.isfinite(known) & np.isfinite(moved))
    if both.size < 2:
        return []
    offset, variance = (known - moved)[both], (known_sd**2 + moved_sd**2)[both]
    off = (offset - np.average(offset, weights=1 / variance)) / np.sqrt(variance)
    if float(chdtrc(both.size - 1, np.square(off).sum())) >= _CONTRADICTED:
        return []
    frames = ", ".join(str(k) for k in both[np.argsort(-np.abs(off))][:2])
    said = "contradicts known_range_m: one offset does not make them agree, least of all in frames "
    return [Problem(pointer, f"{said}{frames} (counted from 0)")]
