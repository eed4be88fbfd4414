"""Readings that have nothing to do with the scene.

Their law is nowhere sharper than what the scene itself expects: else readings that are exactly as
expected, of an object that may be anywhere near, would be outliers because of it.
"""

import math

from inference.tracking.frame_density import TrackedFrame, spread_at
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    Hypotheses,
    U,
    V,
    learns_crosstalk,
)
from inference.tracking.motion import Rules
from inference.tracking.readings_table import (
    ReadingsTable,
    mean_at,
    noise_root,
    object_at,
)
from inference.tracking.roots import UNIT, add_factor
from simulator.compiled import compiled

__all__ = ["expected_readings", "log_outlier"]


@compiled
def log_outlier(
    frame: TrackedFrame,
    expected: tuple[float, float, float],
    table: ReadingsTable,
    rules: Rules,
) -> float:
    """Return the log density of readings that have nothing to do with the scene.

    A Cauchy law around what was expected: its tails forgive any reading, in whatever unit.

    Parameters
    ----------
    frame : TrackedFrame
        The readings.
    expected : (float, float, float)
        Their means, and the root of the determinant of their covariance, as expected.
    table, rules : ReadingsTable, Rules
        How many readings are used, and the least width of the law.
    """
    mean1, mean2, spread = expected
    one = table.channels == 1
    breadth = max(rules.breadth, spread if one else math.sqrt(spread))
    e1, e2 = (frame.first - mean1) / breadth, (frame.second - mean2) / breadth
    square = 1.0 + e1 * e1 + e2 * e2
    if one:
        return 0.5 * math.log(2.0 / math.pi) - math.log(breadth * square)
    return -2.0 * math.log(breadth) - 1.5 * math.log(square)


@compiled
def expected_readings(
    of: Hypotheses, row: int, gain: float, table: ReadingsTable
) -> tuple[float, float, float]:
    """Return the readings at the mean of a hypothesis, and how far they may be from there.

    Returns
    -------
    (float, float, float)
        Means of both readings, and the root of the determinant of their covariance, linear in the
        hypothesis, all in units of the noise.
    """
    x, X, u = of.x, of.X, of.x[row, U]
    value1, value2, d1, d2 = mean_at(u, table)
    learns, n = learns_crosstalk(of), X.shape[1]
    along, rate = (gain * x[row, V], gain) if table.by_rate else (gain, 0.0)
    m1, m2 = along * value1, along * value2
    root = UNIT
    if not table.by_rate:
        m1, m2 = m1 + table.crosstalk1, m2 + table.crosstalk2
        if learns:
            m1, m2 = m1 + x[row, CROSSTALK1], m2 + x[row, CROSSTALK2]
        if not table.noise.plain:
            o1, o2 = object_at(u, table)
            root = noise_root(m1, m2, gain * o1, gain * o2, table.noise)
    for j in range(n):
        by_u, by_v = along * X[row, U, j], rate * X[row, V, j]
        f1, f2 = d1 * by_u + value1 * by_v, d2 * by_u + value2 * by_v
        if learns:
            f1, f2 = f1 + X[row, CROSSTALK1, j], f2 + X[row, CROSSTALK2, j]
        root = add_factor(root, f1, f2)
    if X.shape[-1] > n and not table.by_rate:
        root = spread_at(root, u, gain, (d1, d2), X[row], table)
    return m1, m2, root.r11 * root.r22
