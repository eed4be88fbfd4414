"""Frames that tell much of a scene: few of every amplitude, and those without the object.

An amplitude is a range, whatever the scene: the choice asks nothing of a scene that is not known.
"""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.tracking.track import Track
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = [
    "EMPTY",
    "UNUSED",
    "Kept",
    "Worth",
    "in_order",
    "kinds_of",
    "nothing_kept",
    "surprising",
    "thinned",
]

EMPTY, UNUSED = -1, -2
"""Kinds of frames besides the steps of amplitude: without the object, and not to be used."""

_STEP = 0.25  # of the log of the amplitude
_STEPS = 40  # of them, the last without an end: 1e4 read noises and more
_A_STEP = 2  # frames of each that are kept, the last ones
_EMPTY_KEPT = 24
_SURELY_EMPTY = 0.02  # probability of an object, below which there is none
_SURPRISING = 2.0  # of the running surprise, which is 1 where all is as modelled
_FILLED = {"gain": 1.0, "object_present": True}


@dataclasses.dataclass(frozen=True, eq=False)
class Kept:
    """Frames in the order in which they came.

    Attributes
    ----------
    frames : Frames or None
        None where there are none.
    sequence, kind : ndarray of int, shape (n,)
        Number of each in its stream; step of its amplitude, `EMPTY` or `UNUSED`.
    """

    frames: Frames | None
    sequence: NDArray[np.int64]
    kind: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.sequence.size)

    def select(self, index: Any) -> "Kept":
        """Return those that a numpy index selects."""
        sequence = self.sequence[index]
        frames = None
        if self.frames is not None and sequence.size:
            frames = self.frames.select(index)
        return Kept(frames, sequence, self.kind[index])

    @property
    def worth(self) -> "Worth":
        """What a calibration may hope for."""
        steps = np.unique(self.kind[self.kind >= 0]).size
        return Worth(int(steps), int((self.kind == EMPTY).sum()), len(self))


@dataclasses.dataclass(frozen=True)
class Worth:
    """How much frames tell.

    Attributes
    ----------
    steps : int
        Different amplitudes with the object.
    empty, frames : int
        Frames without it, and all.
    """

    steps: int = 0
    empty: int = 0
    frames: int = 0

    @property
    def points(self) -> int:
        """One number to compare by."""
        return self.steps + min(self.empty, 8)


def nothing_kept() -> Kept:
    """Return no frames."""
    none = np.zeros(0, dtype=np.int64)
    return Kept(None, none, none)


def in_order(first: Kept, second: Kept) -> Kept:
    """Return frames one after another; a column that only some have says nothing in the others."""
    sequence = np.concatenate([first.sequence, second.sequence])
    kind = np.concatenate([first.kind, second.kind])
    if first.frames is None or second.frames is None:
        return Kept(first.frames or second.frames, sequence, kind)
    columns: dict[str, Any] = {}
    for field in dataclasses.fields(Frames):
        a, b = getattr(first.frames, field.name), getattr(second.frames, field.name)
        if a is not None or b is not None:
            columns[field.name] = _column(field.name, a, b, len(first), len(second))
    return Kept(Frames(**columns), sequence, kind)


def _column(name: str, a: Any, b: Any, n: int, m: int) -> Any:
    filled = _FILLED.get(name, np.nan)
    if a is None or b is None:
        if name in ("derivatives", "temperature_k"):
            return None  # nothing stands for one that is missing
        a = np.full(n, filled) if a is None else a
        b = np.full(m, filled) if b is None else b
    return np.concatenate([a, b])


def kinds_of(sensor: Sensor, frames: Frames, track: Track, trusts_empty: bool) -> NDArray[np.int64]:
    """Sort frames by what they may tell.

    Parameters
    ----------
    sensor, frames, track : Sensor, Frames, Track
        The frames, and what the tracker said of them.
    trusts_empty : bool
        Whether the scene is known so well that the tracker can tell when the object is away.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    size = np.abs(frames.readings / np.asarray(sensor.noise.read)).max(axis=1)
    with np.errstate(divide="ignore"):
        steps = np.floor(np.log(np.maximum(size, 1.0)) / _STEP)
    kind = np.minimum(steps, _STEPS - 1).astype(np.int64)
    trusted = ~track.misfit | track.in_a_row
    kind[(track.outlier > 0.5) & trusted] = UNUSED
    if trusts_empty:
        kind[(track.present < _SURELY_EMPTY) & trusted] = EMPTY
    if frames.object_present is not None:
        kind[~frames.object_present] = EMPTY
    kind[frames.saturated(sensor)] = UNUSED
    return np.asarray(kind, dtype=np.int64)


def surprising(track: Track) -> NDArray[np.bool_]:
    """Tell which frames speak against a scene: more than a tracker calls a misfit.

    Errors that all frames share may surprise for long, by as much as one frame may, and a tracker
    lets them. Here a surprise of 2 that stays is reason enough: under a scene that is right it
    happens to one calibration in seven (exp(-2)), and costs width and another one.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    with np.errstate(invalid="ignore"):
        beyond = (track.surprise > _SURPRISING) | (track.outlier > 0.5)
    return np.asarray(track.misfit | beyond)


def thinned(kept: Kept, oldest: int) -> Kept:
    """Return the last few of each kind.

    Parameters
    ----------
    kept : Kept
        Frames.
    oldest : int
        Least number that counts.

    Returns
    -------
    Kept
        At most `_A_STEP` frames of every amplitude and `_EMPTY_KEPT` without the object.
    """
    stays = np.zeros(len(kept), dtype=bool)
    usable = (kept.sequence >= oldest) & (kept.kind != UNUSED)
    for kind in np.unique(kept.kind[usable]).tolist():
        most = _EMPTY_KEPT if kind == EMPTY else _A_STEP
        stays[np.flatnonzero(usable & (kept.kind == kind))[-most:]] = True
    return kept.select(stays)
