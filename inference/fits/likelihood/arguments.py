"""What the kernels of a fit take, and the physical values that are its unknowns."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, Pair, Rows
from inference.frame.blocks import Data
from inference.frame.sensitivity import Value

__all__ = ["CROSSTALK", "SLOTS", "Bounds", "Fit", "Layout", "Place", "Static"]

# kernels freeze what stands here into machine code, so that this file is hashed with them, as every
# file is that holds the line `from simulator.compiled import compiled`

Array = NDArray[np.float64]

SLOTS = int(Value.LOG_RANGE)
"""Physical values that may be unknown, in the order of `Value`."""

CROSSTALK = (Value.CROSSTALK_1, Value.CROSSTALK_2)


class Static(NamedTuple):
    """The light of the bare background as the coordinates of crosstalk have it.

    Attributes
    ----------
    share : float
        Of the background's readings that is added to crosstalk: the frames' gain factor, or 0
        where the coordinates are crosstalk alone.
    r0 : float
        Of a pulse [m].
    wave_number, phase : float
        Of a sine wave [rad/m], [rad]; a wave number of 0 is a pulse.
    """

    share: float
    r0: float
    wave_number: float
    phase: float


class Layout(NamedTuple):
    """Which physical value is which coordinate.

    Attributes
    ----------
    coordinate : ndarray of int, shape (SLOTS,)
        Coordinate of each value; `coordinates.KNOWN` for a known number, `coordinates.SAME` for
        the object's number in its shadow.
    known : ndarray, shape (SLOTS,)
        Known numbers.
    least, largest : ndarray, shape (SLOTS,)
        Bounds of the physical values; of crosstalk, of its coordinates.
    static : Static
        What the coordinates of crosstalk have in them beside it.
    """

    coordinate: NDArray[np.int64]
    known: Array
    least: Array
    largest: Array
    static: Static


class Bounds(NamedTuple):
    """Least and largest value of each coordinate, each of shape (d,)."""

    low: Array
    high: Array


class Place(NamedTuple):
    """Coordinates, and what the likelihood finds there.

    Attributes
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    values : ndarray, shape (SLOTS,)
        Physical values.
    best : ndarray, shape (1, frames, 3)
        Best log r of every frame, its log density and standard deviation.
    """

    x: Array
    values: Array
    best: Array


class Fit(NamedTuple):
    """A fit, readings in the problem's unit.

    Attributes
    ----------
    layout : Layout
        The unknowns.
    rows : Rows
        Work space for one parameter vector.
    data : Data
        The frames.
    instrument : Instrument
        The sensor.
    gain : float
        Its gain.
    background : bool or None
        None where the scene has none.
    support : (float, float)
        Ranges that the scene allows [m].
    """

    layout: Layout
    rows: Rows
    data: Data
    instrument: Instrument
    gain: float
    background: bool | None
    support: Pair
