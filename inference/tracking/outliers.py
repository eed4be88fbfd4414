"""Readings that have nothing to do with the scene."""

import math

from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    Hypotheses,
    U,
    V,
    learns_crosstalk,
)
from inference.tracking.motion import Rules
from inference.tracking.readings_table import ReadingsTable, mean_at
from simulator.compiled import compiled

__all__ = ["expected_readings", "log_outlier"]


@compiled
def log_outlier(
    frame: TrackedFrame, mean1: float, mean2: float, table: ReadingsTable, rules: Rules
) -> float:
    """Return the log density of readings that have nothing to do with the scene.

    A Cauchy law around what was expected: its tails forgive any reading, in whatever unit.
    """
    breadth = rules.breadth
    e1, e2 = (frame.first - mean1) / breadth, (frame.second - mean2) / breadth
    square = 1.0 + e1 * e1 + e2 * e2
    if table.channels == 1:
        return 0.5 * math.log(2.0 / math.pi) - math.log(breadth * square)
    return -2.0 * math.log(breadth) - 1.5 * math.log(square)


@compiled
def expected_readings(
    of: Hypotheses, row: int, gain: float, table: ReadingsTable
) -> tuple[float, float]:
    """Return the readings at the mean of a hypothesis."""
    x = of.x
    value1, value2, _, _ = mean_at(x[row, U], table)
    if table.by_rate:
        return gain * value1 * x[row, V], gain * value2 * x[row, V]
    m1, m2 = gain * value1 + table.crosstalk1, gain * value2 + table.crosstalk2
    if learns_crosstalk(of):
        m1, m2 = m1 + x[row, CROSSTALK1], m2 + x[row, CROSSTALK2]
    return m1, m2
