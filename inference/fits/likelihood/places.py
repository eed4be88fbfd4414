"""Frames at one place, which share what following errors of the model leaves of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument

__all__ = ["Places", "places_of"]

Array = NDArray[np.float64]

_NEXT = 6.0  # standard deviations of noise between readings at one place that are neighbours
_WIDEST = 8.0  # from the least to the greatest there: more of a thousand frames in 1e-5 of cases


class Places(NamedTuple):
    """Which frames read alike but for noise.

    Attributes
    ----------
    of_frame : ndarray of int, shape (n,)
        Number of the place; -1 of a frame that is alone at its own.
    number : int
        How many places have more than one.
    """

    of_frame: NDArray[np.intp]
    number: int

    def select(self, index: NDArray[np.intp]) -> "Places":
        """Return the places of some of the frames, their numbers as they are."""
        return self._replace(of_frame=self.of_frame[index])


def places_of(frames: Array, present: NDArray[np.bool_], instrument: Instrument) -> Places | None:
    """Find frames that read alike but for noise, apart from all others.

    Frames along a path that are so near one another that none is apart are at no place.

    Parameters
    ----------
    frames : ndarray, shape (n, 3)
        Readings and gain factor.
    present : ndarray of bool, shape (n,)
        Where an object may be.
    instrument : Instrument
        Readings in the same unit.

    Returns
    -------
    Places or None
        None where every frame is alone.
    """
    readings, gain = frames[:, :2], frames[:, 2:]
    variance = np.square(instrument.read) + (instrument.shot or 0.0) * np.abs(readings)
    noise = np.sqrt(variance + np.square((instrument.relative or 0.0) * readings)) / gain
    light = readings / gain
    size, widest = np.hypot(light[:, 0], light[:, 1]), noise.max(axis=1)
    order = np.flatnonzero(present)[np.argsort(size[present], kind="stable")]
    apart = np.diff(size[order]) > _NEXT * np.maximum(widest[order][1:], widest[order][:-1])
    of_frame, count = np.full(len(frames), -1, dtype=np.intp), 0
    for group in np.split(order, np.flatnonzero(apart) + 1):
        alike = np.ptp(light[group], axis=0) <= _WIDEST * noise[group].max(axis=0, initial=0.0)
        if group.size > 1 and alike.all():
            of_frame[group] = count
            count += 1
    return Places(of_frame, count) if count else None
