"""Solve a technique that inverts a curve: targets in, candidates out."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import NOISE_BAND, Candidates
from inference.realtime.solving.invert import invert
from inference.realtime.solving.monotone_intervals import pieces_of
from inference.technique import Task

__all__ = ["candidates_of", "widened"]

T = TypeVar("T", bound=np.generic)
Array = NDArray[np.float64]

_CHUNK = 200_000  # candidate roots held at a time, so that they stay in the cache


def candidates_of(
    task: Task,
    kind: int,
    high_m: float,
    top: Array,
    sd: Array,
    bottom: Array | None = None,
    period: float = 0.0,
) -> tuple[Candidates, Array]:
    """Find all roots of a curve for every frame.

    Parameters
    ----------
    task : Task
        Gives the curve's parameters.
    kind : int
        The curve.
    high_m : float
        Upper end of the technique's interval [m]; the task may set another.
    top, bottom : ndarray, shape (n,)
        Targets top / bottom, in lengths of ``task.known.unit``; nan where there is none.
    sd : ndarray, shape (n,)
        Standard deviation of the target.
    period : float
        The target is known modulo this number; 0 if it is not an angle.

    Returns
    -------
    Candidates
        Roots in metres.
    ndarray, shape (n, m)
        The curve's slope at the roots [target / m].
    """
    unit = task.known.unit
    p = task.known.curve_parameters(task.sensor)
    high = (high_m if task.high_m is None else task.high_m) / unit
    pieces = pieces_of(kind, p, 0.0, high)
    ones = np.ones_like(top)
    bottom = ones if bottom is None else bottom
    step = max(_CHUNK // max(pieces.ends.shape[0], 1), 1)
    parts = [
        _trimmed(
            invert(
                kind,
                top[i : i + step],
                bottom[i : i + step],
                p,
                pieces.ends,
                pieces.values,
                pieces.folds,
                period,
            )
        )
        for i in range(0, top.size, step)
    ]
    roots, slopes, gaps, nearest = parts[0] if len(parts) == 1 else _joined(parts)
    with np.errstate(all="ignore"):
        slopes = slopes / unit
        candidates = Candidates(
            roots=roots * unit,
            sd=sd[:, None] / np.abs(slopes),
            near=gaps < NOISE_BAND * sd[:, None],
            near_frame=nearest < NOISE_BAND * sd,
        )
    return candidates, slopes


def _joined(parts: Sequence[tuple[Array, ...]]) -> tuple[Array, Array, Array, Array]:
    width = max(part[0].shape[1] for part in parts)
    roots, slopes, gaps = (
        np.concatenate([widened(part[j], width) for part in parts]) for j in range(3)
    )
    return roots, slopes, gaps, np.concatenate([part[3] for part in parts])


def _trimmed(part: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """Drop the columns that no frame uses: roots fill them from the left."""
    roots, slopes, gaps, nearest = part
    used = max(int(np.count_nonzero(np.isfinite(roots).any(axis=0))), 1)
    return roots[:, :used], slopes[:, :used], gaps[:, :used], nearest


def widened(array: NDArray[T], width: int) -> NDArray[T]:
    """Pad columns with nan, or False."""
    if array.shape[1] == width:
        return array
    wide = np.full((array.shape[0], width), np.nan if array.dtype.kind == "f" else 0, array.dtype)
    wide[:, : array.shape[1]] = array
    return wide
