"""Whether readings change smoothly enough from frame to frame for a derivative in time.

A window of frames tells the derivative of what a polynomial can follow. An object that jumps, or
turns back within a frame, moves along a chord of the curve of readings; its direction is that of
some range in between, whatever windows agree upon.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net

__all__ = ["Uneven", "rough"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_UNLIKE = 1.0  # change of a rate over its mean: more than three times as fast, or back
_TOLD = 4.0  # standard deviations above which a change is none of noise
# Share of the frames that tell, above which no frame is believed: an uneven one takes itself and
# two on either side, so that of a fifth, spread over a track, nothing is left but by chance
_SHARE = 0.2
_FEWEST = 2  # one turn, or one jump, is no rough motion: what is beside it is left out anyway
_BY_CHANCE = 0.01  # rate, at most, at which noise alone makes all frames of a smooth motion uneven
_AROUND = 2  # frames on either side, whose windows hold an uneven one


class Uneven(NamedTuple):
    """Where readings change unevenly, each of shape (n,).

    Attributes
    ----------
    at : ndarray of bool
        Frames at which the rate changes threefold, or turns back, by more than its noise.
    near : ndarray of bool
        Those and the two on either side: they have no derivative that differences could find.
    """

    at: Flags
    near: Flags


def rough(time_s: Array, net: Net, gain: Array | None) -> Uneven:
    """Tell where readings change unevenly.

    At all frames, where that is so at a fifth of the frames whose rates are told at all, and at
    one of them by more than noise does anywhere in so many frames.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times, increasing [s].
    net : Net
        Readings of the frames and their noise.
    gain : ndarray, shape (n,), optional
        Factors of the frames on the sensor's gain, where differences must not mix them.

    Returns
    -------
    Uneven
    """
    n = time_s.size
    if n < 3:
        return Uneven(np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_))
    with np.errstate(all="ignore"):
        step = np.diff(time_s)
        reading_sd = np.sqrt(np.column_stack([net.var1, net.var2]))
        # in units of the noise; relative to the shortest step, so that nothing overflows
        values = np.column_stack([net.first, net.second])
        noise = np.maximum(reading_sd[:-1], reading_sd[1:])
        rate = np.diff(values, axis=0) / noise * (step.min() / step)[:, None]
        own = np.sqrt(2.0) * step.min() / step
        change = np.hypot(*(rate[1:] - rate[:-1]).T)
        mean = np.hypot(*(rate[1:] + rate[:-1]).T) / 2.0
        sd = np.hypot(own[1:], own[:-1])
        blur = _TOLD * sd
        told = np.maximum(change, mean) > blur
        uneven = told & (change - blur > _UNLIKE * mean)
        # successive rates share a reading, so that their change has up to 3/2 of the sum of their
        # variances; of two readings it has Rayleigh's law
        largest = np.sqrt(3.0 * np.log(n / _BY_CHANCE)) * sd
        sure = uneven & (change - largest > _UNLIKE * mean)
        if gain is not None:
            same = (gain[1:-1] == gain[:-2]) & (gain[1:-1] == gain[2:])
            told, uneven, sure = told & same, uneven & same, sure & same
    count = int(uneven.sum())
    if sure.any() and count >= _FEWEST and count > _SHARE * int(told.sum()):
        return Uneven(np.ones(n, dtype=np.bool_), np.ones(n, dtype=np.bool_))
    places = np.flatnonzero(uneven) + 1
    found = Uneven(np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_))
    found.at[places] = True
    for away in range(-_AROUND, _AROUND + 1):
        near = places + away
        found.near[near[(near >= 0) & (near < n)]] = True
    return found
