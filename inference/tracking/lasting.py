"""Whether what is left of the readings across the curve lasts, by more than errors may.

A surprise is of one frame, and noise is most of it. The mean of thirty frames has a fifth of the
noise, and errors that all frames share as they are. So it tells another object than the one that is
stated, or light that nobody stated, where no frame by itself does.

docs/model.md, lasting, has the statistic.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2, Hypotheses, learns_crosstalk
from inference.tracking.readings_table import ReadingsTable, mean_at
from simulator.compiled import compiled

__all__ = ["STATED", "crosstalk_variance", "first_lasting", "lasting_of", "sagitta", "take_lasting"]

Array = NDArray[np.float64]

# places in its part of `Hypotheses.numbers`, the last: running means of what is left across the
# curve, of what the bend of the curve may leave there, of the variance there by crosstalk, and of
# what every nuisance parameter does there; all in units of the noise
_DEVIATION, _BEND, _CROSSTALK, _SHARES = range(4)
_MOST = 3.9  # noise of a single frame beyond which its deviation is cut: once in 10,000
_REACH = 2.0  # standard deviations of log r over which the curve's bend is taken
STATED = 0.2  # noise by which crosstalk is off that is stated as the mean of 25 frames
_BENT = 0.5  # noise beyond which the bend hides what is looked for, and a frame is left out


def first_lasting(nuisance: int) -> list[float]:
    """Return these numbers before any frame, of so many nuisance parameters."""
    return [0.0] * (_SHARES + nuisance)


@borrowed
@compiled
def sagitta(u: float, sd: float, across1: float, across2: float, table: ReadingsTable) -> float:
    """Return by how much the curve bends away across itself, as far as log r is open."""
    low, high = max(u - _REACH * sd, table.start), min(u + _REACH * sd, table.end)
    here1, here2, _, _ = mean_at(u, table)
    low1, low2, _, _ = mean_at(low, table)
    high1, high2, _, _ = mean_at(high, table)
    below = across1 * (low1 - here1) + across2 * (low2 - here2)
    above = across1 * (high1 - here1) + across2 * (high2 - here2)
    return max(abs(below), abs(above))


@borrowed
@compiled
def crosstalk_variance(
    of: Hypotheses, row: int, across1: float, across2: float, table: ReadingsTable
) -> float:
    """Return the variance across the curve of crosstalk that is learnt or stated, 0 where none is.

    Whoever states a number has measured it: a scene without crosstalk is taken at its word.
    """
    variance = 0.0
    if table.crosstalk1 != 0.0 or table.crosstalk2 != 0.0:
        variance = STATED * STATED
    if learns_crosstalk(of):
        for k in range(of.X.shape[-1]):
            part = across1 * of.X[row, CROSSTALK1, k] + across2 * of.X[row, CROSSTALK2, k]
            variance += part * part
    return variance


@borrowed
@compiled
def take_lasting(
    numbers: Array,
    nuisance: int,
    deviation: float,
    bend: float,
    crosstalk: float,
    memory: float,
) -> None:
    """Take a frame into the running means, unless its range is too open to tell.

    Parameters
    ----------
    numbers : ndarray
        All of the state's numbers, changed in place. Right before its own stands what every
        nuisance parameter does across the curve in this frame.
    nuisance : int
        Number of nuisance parameters.
    deviation : float
        What is left of the frame's readings across the curve, in units of the noise there.
    bend : float
        What the bend of the curve may leave there.
    crosstalk : float
        Variance of the crosstalk, there.
    memory : float
        Of the running means.
    """
    if bend > _BENT:
        return
    first = numbers.size - nuisance - _SHARES
    new, square = 1.0 - memory, crosstalk
    for j in range(nuisance):
        share = numbers[first - nuisance + j]
        square += share * share
        numbers[first + _SHARES + j] += new * (share - numbers[first + _SHARES + j])
    # a frame counts as far as noise and the errors that are known may move it
    most = _MOST * math.sqrt(1.0 + square) + bend
    own = min(max(deviation, -most), most)
    numbers[first + _DEVIATION] += new * (own - numbers[first + _DEVIATION])
    numbers[first + _BEND] += new * (bend - numbers[first + _BEND])
    numbers[first + _CROSSTALK] += new * (crosstalk - numbers[first + _CROSSTALK])


@borrowed
@compiled
def lasting_of(numbers: Array, nuisance: int, memory: float) -> float:
    """Return the mean of what is left across the curve, in standard deviations of what may be.

    Parameters
    ----------
    numbers : ndarray
        All of the state's numbers.
    nuisance : int
        Number of nuisance parameters.
    memory : float
        Of the running means.
    """
    first = numbers.size - nuisance - _SHARES
    variance = (1.0 - memory) / (1.0 + memory) + numbers[first + _CROSSTALK]
    for j in range(nuisance):
        share = numbers[first + _SHARES + j]
        variance += share * share
    beyond = abs(numbers[first + _DEVIATION]) - numbers[first + _BEND]
    return float(max(beyond, 0.0) / math.sqrt(variance))
