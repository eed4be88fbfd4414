"""One frame and the empty scene: how well it explains the frame, and what crosstalk it tells."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    PENDING,
    Hypotheses,
    Scratch,
    learns_crosstalk,
    log_of,
)
from inference.tracking.light import noise_at_light
from inference.tracking.motion import Rules
from inference.tracking.outliers import log_outlier
from inference.tracking.readings_table import FIRST, SECOND, ReadingsTable
from inference.tracking.roots import UNIT, Root, add_factor, solve
from inference.tracking.square_root import Linear, update
from simulator.compiled import compiled

__all__ = [
    "NEVER",
    "Empty",
    "Expected",
    "expect_empty",
    "learn_empty",
    "weigh_empty",
]

Array = NDArray[np.float64]


NEVER = -1e300
"""Log mass of what cannot be."""


class Empty(NamedTuple):
    """What the empty scene says of a frame."""

    # log masses of no object: with readings as expected, and with an outlier
    usual: float
    odd: float
    odd_born: float  # log mass of an object that has come, of unknown range, and an outlier
    strange: float  # log density of the readings as an outlier of it
    surprise: float  # normalised innovation squared


class Expected(NamedTuple):
    """What the empty scene expects of a frame."""

    log_density: float  # of the frame, without the log of 2 pi
    surprise: float  # normalised innovation squared
    # expected readings
    mean1: float
    mean2: float
    spread: float  # root of the determinant of their covariance
    noise: Root  # of their noise's covariance


@compiled
def expect_empty(
    of: Hypotheses,
    row: int,
    frame: TrackedFrame,
    table: ReadingsTable,
    empty: Array,
    nuisance: Array,
) -> Expected:
    """Hold a frame against the empty scene.

    Parameters
    ----------
    of, row : Hypotheses, int
        The row that holds its crosstalk, where that is learnt: 0 but for a rival of it
        (`inference.tracking.stated_empty`).
    frame : TrackedFrame
        The frame.
    table : ReadingsTable
        Known crosstalk, and the noise.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene without crosstalk, and their change with the nuisance
        parameters.
    nuisance : ndarray, shape (2, p)
        Filled with that change in this frame.
    """
    x, X, gain = of.x, of.X, frame.gain
    _, n, m = X.shape
    learns = learns_crosstalk(of)
    m1 = gain * empty[FIRST, 0] + table.crosstalk1
    m2 = gain * empty[SECOND, 0] + table.crosstalk2
    if learns:
        m1, m2 = m1 + x[row, CROSSTALK1], m2 + x[row, CROSSTALK2]
    e1, e2 = frame.first - m1, frame.second - m2
    noise = UNIT
    if not table.noise.plain and not table.by_rate:
        unknown = Root(0.0, 0.0, 0.0)
        for j in range(n if learns else 0):
            unknown = add_factor(unknown, X[row, CROSSTALK1, j], X[row, CROSSTALK2, j])
        noise = noise_at_light((m1, m2), (0.0, 0.0), (e1, e2), unknown, table.noise)
    root = noise
    for j in range(m):
        f1, f2 = 0.0, 0.0
        if learns:
            f1, f2 = X[row, CROSSTALK1, j], X[row, CROSSTALK2, j]
        if j >= n:
            g1, g2 = gain * empty[FIRST, 1 + j - n], gain * empty[SECOND, 1 + j - n]
            nuisance[FIRST, j - n], nuisance[SECOND, j - n] = g1, g2
            f1, f2 = f1 + g1, f2 + g2
        root = add_factor(root, f1, f2)
    pull1, pull2 = solve(root, e1, e2)
    surprise = e1 * pull1 + e2 * pull2
    log_density = -0.5 * surprise - math.log(root.r11 * root.r22)
    return Expected(log_density, surprise, m1, m2, root.r11 * root.r22, noise)


@borrowed
@compiled
def learn_empty(
    of: Hypotheses, frame: TrackedFrame, table: ReadingsTable, empty: Array, scratch: Scratch
) -> float:
    """Learn the crosstalk from a frame of the empty scene, where it is learnt; its surprise.

    Parameters
    ----------
    of : Hypotheses
        Row 0 is the empty scene; changed in place.
    frame, table, empty
        As for `expect_empty`.
    scratch : Scratch
        Overwritten.
    """
    expected = expect_empty(of, 0, frame, table, empty, scratch.nuisance)
    if learns_crosstalk(of):
        e1, e2 = frame.first - expected.mean1, frame.second - expected.mean2
        update(of, 0, Linear(e1, e2, 0.0, 0.0, 0.0, 0.0, expected.noise), scratch, of.X.shape[1])
    return expected.surprise


@borrowed
@compiled
def weigh_empty(
    frame: TrackedFrame,
    of: Hypotheses,
    table: ReadingsTable,
    empty: Array,
    rules: Rules,
    scratch: Scratch,
) -> Empty:
    """Weigh the empty scene, and an object that has come and is not seen.

    Where the range is known there is an object, and its range is not unknown.

    Parameters
    ----------
    frame : TrackedFrame
        The frame.
    of : Hypotheses
        As predicted.
    table, empty
        As for `expect_empty`.
    rules : Rules
        How often frames are outliers.
    scratch : Scratch
        Overwritten.
    """
    expected = expect_empty(of, 0, frame, table, empty, scratch.nuisance)
    strange = log_outlier(frame, (expected.mean1, expected.mean2, expected.spread), table, rules)
    if frame.known_rate > 0.0:
        return Empty(NEVER, NEVER, NEVER, strange, expected.surprise)
    log_usual, log_odd = math.log1p(-rules.outlier), math.log(rules.outlier)
    log_empty = log_of(of.weight[0])
    return Empty(
        log_empty + log_usual + expected.log_density,
        log_empty + log_odd + strange,
        log_of(of.numbers[PENDING]) + log_odd + strange,
        strange,
        expected.surprise,
    )
