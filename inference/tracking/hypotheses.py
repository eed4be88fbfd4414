"""The filter's weighted hypotheses, as arrays that are changed in place.

A hypothesis holds the mean x of (u, du/dt) and, where crosstalk drifts, of two crosstalk readings;
n is 2 or 4 (x then has a fifth column, `inference.tracking.shared_error`). Its error is X w with w
standard normal: the first n columns of X are its own, lower triangular; the last p belong to the
nuisance parameters, which all frames share.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = [
    "ANCHOR",
    "BRIGHT",
    "COUNT",
    "CROSSTALK1",
    "CROSSTALK2",
    "HELD",
    "LATE1",
    "LATE2",
    "LEVEL1",
    "LEVEL2",
    "LOST",
    "PENDING",
    "RESTING",
    "RIVAL",
    "RIVAL1",
    "RIVAL2",
    "RIVAL_GAIN",
    "RIVAL_TIME",
    "RIVAL_VARIANCE",
    "ROUGHNESS",
    "RUN",
    "RUNNING",
    "SAME",
    "SINCE",
    "STAY1",
    "STAY2",
    "STAYED",
    "STILL",
    "TIME",
    "TOLD",
    "TOLD1",
    "TOLD2",
    "TOLD11",
    "TOLD21",
    "TOLD22",
    "WITHOUT_CROSSTALK",
    "Hypotheses",
    "Scratch",
    "U",
    "V",
    "copied",
    "copy",
    "heaviest",
    "learns_crosstalk",
    "log_of",
    "scratch_for",
    "stuck_for",
    "take_readings",
    "unknown_crosstalk",
    "variance_of",
]

Array = NDArray[np.float64]

# states of a hypothesis: log r, its rate, crosstalk, and the log r at which tangents are taken
U, V, CROSSTALK1, CROSSTALK2, ANCHOR = range(5)
WITHOUT_CROSSTALK = 2  # own states of a hypothesis that does not learn it
# places in `Hypotheses.numbers`
TIME, PENDING, RUNNING, COUNT, LOST, ROUGHNESS, SAME, _READ1, _READ2, _STEP1, _STEP2 = range(11)
RESTING, LEVEL1, LEVEL2 = range(11, 14)
STILL, SINCE, STAYED, STAY1, STAY2, LATE1, LATE2, BRIGHT = range(14, 22)
TOLD = 22
HELD, RIVAL, RUN, RIVAL1, RIVAL2, RIVAL_VARIANCE, RIVAL_GAIN, RIVAL_TIME = range(23, 31)
TOLD1, TOLD2, TOLD11, TOLD21, TOLD22 = range(31, 36)
_LEAST = -700.0  # log of a weight that underflows
_ROOT_8 = math.sqrt(8.0)
# probability of no change at all from which on readings that do not change say nothing: thirty
# frames of the same readings then have a probability of 6e-7
_STAY = 0.62


class Hypotheses(NamedTuple):
    """What the filter knows after a frame."""

    # (rows, n), a column more where crosstalk is learnt: means of log r, its rate [1/s] and, if
    # learnt, the crosstalk [units of the noise] and the log r at which tangents are taken; row 0 is
    # the empty scene, rows that are not in use are arbitrary
    x: Array
    X: Array  # (rows, n, n + p): roots of the covariances
    weight: Array  # (rows,): probabilities
    # (36,), more where errors that frames share are felt (`inference.tracking.unsteady`): time of
    # the last frame [s] (nan: none yet), probability of an object of which nothing is known yet,
    # running surprise, number of hypotheses, whether an object that was there may be anywhere by
    # now, the surprise of the last frames, each cut at 1, how many frames up to the last had the
    # readings of the one before, these readings, the shortest step of each from one frame to
    # the next (inf: none yet), where crosstalk is learnt whether its light may be that of an object
    # at rest (`inference.tracking.resting`), what the crosstalk was before anything changed, and
    # of readings that stay as they are (`inference.tracking.stillness`) whether they do, since when
    # [s], in how many frames, their mean, that of late, and the gain's factor, what is known of the
    # crosstalk without any object (`inference.tracking.without_object`), and of frames that are
    # stated empty (`inference.tracking.stated_empty`) how many agree with what is held of the
    # crosstalk, how many with its rival, how many of the last were passed over, and of the rival
    # the mean of its frames without the scene's light, its variance in that of a frame's noise, the
    # mean of their factors on the gain, and the time that the variance is of [s], and of what is
    # known of the crosstalk without any object its mean and the triangular root of its covariance
    numbers: Array


class Scratch(NamedTuple):
    """Arrays that are overwritten."""

    nuisance: Array  # (2, p): change of the readings with the nuisance parameters
    work: Array  # (n, at least 4 n + p + 4): to be made triangular
    # (2, n + p): root of the covariance that a hypothesis expects of the readings, and the inverse
    # of the whole covariance times it
    factors: Array
    pulls: Array


@compiled
def scratch_for(of: Hypotheses) -> Scratch:
    """Return arrays to work in."""
    _, n, m = of.X.shape
    return Scratch(
        np.zeros((2, m - n)), np.zeros((n, 4 * n + m + 4)), np.zeros((2, m)), np.zeros((2, m))
    )


def copied(of: Hypotheses) -> Hypotheses:
    """Return a copy that shares nothing."""
    return Hypotheses(*(array.copy() for array in of))


@compiled
def learns_crosstalk(of: Hypotheses) -> bool:
    """Tell whether the crosstalk is part of a hypothesis."""
    return bool(of.X.shape[1] > WITHOUT_CROSSTALK)


@compiled
def copy(into: Hypotheses, row: int, of: Hypotheses, other: int) -> None:
    """Put one hypothesis in the place of another, without its weight."""
    for i in range(of.x.shape[1]):
        into.x[row, i] = of.x[other, i]
    for i in range(of.X.shape[1]):
        for j in range(of.X.shape[-1]):
            into.X[row, i, j] = of.X[other, i, j]


@compiled
def variance_of(of: Hypotheses, row: int, state: int) -> float:
    """Return the variance of one state, without what nuisance parameters do to it."""
    variance = 0.0
    for j in range(of.X.shape[1]):
        variance += of.X[row, state, j] * of.X[row, state, j]
    return variance


@compiled
def unknown_crosstalk(of: Hypotheses, row: int) -> float:
    """Return the larger variance of a reading by crosstalk, in that of the noise."""
    return float(max(variance_of(of, row, CROSSTALK1), variance_of(of, row, CROSSTALK2)))


@compiled
def heaviest(of: Hypotheses) -> int:
    """Return the row of the heaviest hypothesis of an object, 0 where none is."""
    row = 0
    for h in range(1, int(of.numbers[COUNT]) + 1):
        if row == 0 or of.weight[h] > of.weight[row]:
            row = h
    return row


@compiled
def log_of(weight: float) -> float:
    """Return the log of a weight, of none that of one which underflows."""
    return math.log(weight) if weight > 0.0 else _LEAST


@compiled
def take_readings(numbers: Array, first: float, second: float) -> None:
    """Count frames whose readings are to the last bit those of the frame before."""
    change1, change2 = abs(first - numbers[_READ1]), abs(second - numbers[_READ2])
    same = change1 == 0.0 and change2 == 0.0
    numbers[SAME] = numbers[SAME] + 1.0 if same else 0.0
    numbers[_READ1], numbers[_READ2] = first, second
    if 0.0 < change1 < numbers[_STEP1]:
        numbers[_STEP1] = change1
    if 0.0 < change2 < numbers[_STEP2]:
        numbers[_STEP2] = change2


@compiled
def stuck_for(numbers: Array) -> float:
    """Return how many frames had the readings of the one before, where noise does not allow that.

    Readings are rounded to steps no longer than the shortest one seen. Noise leaves a reading in
    the middle of a step of length L with probability erf(L / sqrt(8)), L in units of the noise.
    """
    if numbers[SAME] == 0.0:
        return 0.0
    stay = 1.0 - math.erfc(numbers[_STEP1] / _ROOT_8)
    stay *= 1.0 - math.erfc(numbers[_STEP2] / _ROOT_8)
    return numbers[SAME] if stay < _STAY else 0.0
