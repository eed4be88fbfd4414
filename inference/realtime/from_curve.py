"""Solve a technique that inverts a curve: targets in, candidates out."""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inference.known import Known
from inference.realtime.assemble import NOISE_BAND, Candidates
from inference.realtime.model_error import model_error_of, point_error, sd_of_roots
from inference.realtime.solving.curves.curve import Curve, CurveParameters
from inference.realtime.solving.invert import invert
from inference.realtime.solving.monotone_intervals import monotone_intervals
from inference.realtime.solving.reach import Span
from inference.technique import Task
from simulator.sensor import Sensor, SineWaveSensor

__all__ = ["candidates_of", "curve_parameters", "stacked"]

T = TypeVar("T", bound=np.generic)
Array = NDArray[np.float64]

_CHUNK = 200_000  # candidate roots held at a time, so that they stay in the cache


def curve_parameters(known: Known, sensor: Sensor) -> CurveParameters:
    """Return what a scene gives the curves, in lengths of ``known.unit``; 0 for what is not known.

    Parameters
    ----------
    known : Known
        The scene's known numbers.
    sensor : Sensor
        Gives the wave number, and the gain in the contrast of background and object.
    """
    unit, numbers = known.unit, known.numbers
    contrast = 0.0
    if known.has("background.strength", "object.c2"):
        strength = known.get("background.strength") / sensor.known_gain
        contrast = strength / known.get("object.c2") * unit * unit
    return CurveParameters(
        c0=numbers.get("object.c0", 0.0) / unit / unit,
        c1=numbers.get("object.c1", 0.0) / unit,
        distance=numbers.get("background.distance_m", 0.0) / unit,
        wave=sensor.wave_number * unit if isinstance(sensor, SineWaveSensor) else 0.0,
        c0_shadow=numbers.get("background.shadow.c0", 0.0) / unit / unit,
        c1_shadow=numbers.get("background.shadow.c1", 0.0) / unit,
        contrast=contrast,
    )


def candidates_of(
    task: Task, curve: Curve, high_m: float, top: Array, sd: Array, bottom: Array | None = None
) -> tuple[Candidates, Array]:
    """Find all roots of a curve for every frame.

    Parameters
    ----------
    task : Task
        Gives the curve's parameters.
    high_m : float
        Upper end of the technique's interval [m]; the task may set another.
    top, bottom : ndarray, shape (n,)
        Targets top / bottom, in lengths of ``task.known.unit``; nan where there is none.
    sd : ndarray, shape (n,)
        Standard deviation of the target.

    Returns
    -------
    Candidates
        Roots in metres.
    ndarray, shape (n, m)
        The curve's slope at the roots [target / m].
    """
    unit = task.known.unit
    p = curve_parameters(task.known, task.sensor)
    high = (high_m if task.high_m is None else task.high_m) / unit
    intervals = monotone_intervals(curve, p, 0.0, high)
    bottom = np.ones_like(top) if bottom is None else bottom
    nearest_m, farthest_m = task.known.support if task.physical else (0.0, math.inf)
    span = Span(nearest_m / unit, min(high, farthest_m / unit), NOISE_BAND)
    step = max(_CHUNK // max(intervals.low.size, 1), 1)
    chunks = [slice(i, i + step) for i in range(0, top.size, step)]
    parts = [
        _trimmed(
            invert(curve.kind, p, intervals, curve.period, top[rows], bottom[rows], sd[rows], span)
        )
        for rows in chunks
    ]
    roots, slopes, gaps, nearest, reaches = parts[0] if len(parts) == 1 else _joined(parts)
    error = model_error_of(task)
    model = None
    if error.flux > 0 or error.range_m > 0:
        model = unit * sd_of_roots(curve.kind, p, roots, slopes, point_error(task, unit))
    with np.errstate(all="ignore"):
        slopes = slopes / unit
        candidates = Candidates(
            roots=roots * unit,
            noise=np.maximum(sd[:, None] / np.abs(slopes), reaches * unit),
            model=model,
            near=gaps < NOISE_BAND * sd[:, None],
            near_frame=nearest < NOISE_BAND * sd,
        )
    return candidates, slopes


Part = tuple[Array, Array, Array, Array, Array]


def _joined(parts: Sequence[Part]) -> Part:
    roots, slopes, gaps, nearest, reaches = zip(*parts, strict=True)
    one = np.concatenate(nearest)
    return stacked(roots), stacked(slopes), stacked(gaps), one, stacked(reaches)


def _trimmed(part: Part) -> Part:
    """Drop the columns that no frame uses: roots fill them from the left."""
    roots, slopes, gaps, nearest, reaches = part
    used = max(int(np.count_nonzero(np.isfinite(roots).any(axis=0))), 1)
    return roots[:, :used], slopes[:, :used], gaps[:, :used], nearest, reaches[:, :used]


def stacked(parts: Sequence[NDArray[T]]) -> NDArray[T]:
    """Stack parts of frames, columns padded with nan or False to the widest part's.

    Parameters
    ----------
    parts : sequence of ndarray, shape (n_i, m_i)
        Filled from the left.

    Returns
    -------
    ndarray, shape (sum of n_i, max of m_i)
    """
    width = max(part.shape[1] for part in parts)
    return np.concatenate([_widened(part, width) for part in parts])


def _widened(array: NDArray[T], width: int) -> NDArray[T]:
    """Pad columns with nan, or False."""
    if array.shape[1] == width:
        return array
    wide = np.full((array.shape[0], width), np.nan if array.dtype.kind == "f" else 0, array.dtype)
    wide[:, : array.shape[1]] = array
    return wide
