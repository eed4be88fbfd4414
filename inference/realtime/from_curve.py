"""Solve a technique that inverts a curve: targets in, candidates out."""

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inference.known import Known
from inference.realtime.assemble import NOISE_BAND, Candidates
from inference.realtime.model_error import PointError, point_error, sd_of_roots
from inference.realtime.solving.curves.curve import Curve, CurveParameters
from inference.realtime.solving.intervals import MonotoneIntervals
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
    task: Task,
    curve: Curve,
    high_m: float,
    top: Array,
    sd: Array,
    bottom: Array | None = None,
    beside: Callable[[Array], Array] | None = None,
    end_band: float = NOISE_BAND,
) -> tuple[Candidates, Array]:
    """Find all roots of a curve for every frame, and where errors may have taken others away.

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
    beside : callable, optional
        Ranges [m], shape (n, m) or (1, m), to standard deviations of the target, shape (n, m), by
        errors of the model beside those of the object's flux and time of flight.
    end_band : float
        Standard deviations within which a target beyond the curve's last value is that of an object
        at the interval's upper end.

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
    span = Span(nearest_m / unit, min(high, farthest_m / unit), NOISE_BAND, end_band)
    error = point_error(task, unit)
    errors = _at_ends(curve, p, intervals, error, None if beside is None else (beside, unit))
    step = max(_CHUNK // max(intervals.low.size, 1), 1)
    chunks = [slice(i, i + step) for i in range(0, top.size, step)]
    parts = [
        _trimmed(
            invert(
                curve.kind,
                p,
                intervals,
                curve.period,
                top[rows],
                bottom[rows],
                sd[rows],
                span,
                errors[rows] if len(errors) > 1 else errors,
            )
        )
        for rows in chunks
    ]
    roots, slopes, gaps, nearest, reaches = parts[0] if len(parts) == 1 else _joined(parts)
    model = None
    if error.flux > 0 or error.late > 0:
        model = unit * sd_of_roots(curve.kind, p, roots, slopes, error)
    with np.errstate(all="ignore"):
        slopes = slopes / unit
        if beside is not None:
            moved = beside(roots * unit) / np.abs(slopes)
            model = moved if model is None else np.hypot(model, moved)
        merged = slopes == 0
        candidates = Candidates(
            roots=roots * unit,
            noise=np.maximum(sd[:, None] / np.abs(slopes), reaches * unit),
            model=model,
            near=gaps < NOISE_BAND * sd[:, None],
            near_frame=(nearest < NOISE_BAND * sd) | merged.any(axis=1),
            merged=merged if merged.any() else None,
        )
    return candidates, slopes


def _at_ends(
    curve: Curve,
    p: CurveParameters,
    intervals: MonotoneIntervals,
    error: PointError,
    beside: tuple[Callable[[Array], Array], float] | None,
) -> Array:
    """Return what errors of the model do to a curve at turns and its end, (n or 1, k, 2)."""
    high = intervals.turns_high.copy()
    high[-1] |= high.size > 1  # where there is one interval alone, nothing is asked of its end
    ends = np.where(
        np.column_stack([intervals.turns_low, high]),
        np.column_stack([intervals.low, intervals.high]),
        np.nan,
    ).reshape(1, -1)
    if not np.isfinite(ends).any():
        return np.zeros((1, intervals.low.size, 2))
    sd = sd_of_roots(curve.kind, p, ends, np.ones_like(ends), error)
    if beside is not None:
        of, unit = beside
        with np.errstate(all="ignore"):
            sd = np.hypot(sd, of(ends * unit))
    sd = np.where(np.isnan(sd), 0.0, sd)
    return np.asarray(sd.reshape(len(sd), -1, 2))


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
