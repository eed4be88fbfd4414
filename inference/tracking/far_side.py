"""How far a range may err to the far side, where crosstalk is learnt.

The light of an object fades with its range, so that a change of the crosstalk is worth more range
the farther the object is. Along what range and crosstalk err in common the filter takes the curve
as straight: one standard deviation of log r for both sides, by the slope at the object. Of a bright
object that is enough. Of a faint one the far side is then far too improbable, and ranges were up to
ten standard deviations too near, in silence. So what is said of a range is as wide as by the slope
at the far end of its own interval. The filter's state stays what it is.

docs/model.md, far-side, has the equation.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import Hypotheses, U, variance_of
from inference.tracking.readings_table import ReadingsTable, mean_at
from simulator.compiled import compiled

__all__ = ["far_side_variance"]

_AT = 1.645  # standard deviations from the range to the far end: of the interval of 90 %
_LEAST_SLOPE = 1e-3  # of the slope here: beyond it anywhere is as far


@borrowed
@compiled
def far_side_variance(of: Hypotheses, row: int, table: ReadingsTable) -> float:
    """Return the variance of log r that the far side of a range has beyond its own.

    The standard deviation times the ratio of two slopes, of the readings along log r: here, and at
    the far end. Where the curve is no flatter there it is none.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; what nuisance parameters do to it plays no part.
    table : ReadingsTable
        Mean readings.
    """
    u, variance = of.x[row, U], variance_of(of, row, U)
    _, _, slope1, slope2 = mean_at(u, table)
    _, _, far1, far2 = mean_at(min(u + _AT * math.sqrt(variance), table.end), table)
    here, there = math.hypot(slope1, slope2), math.hypot(far1, far2)
    if not here > there:
        return 0.0
    ratio = here / max(there, _LEAST_SLOPE * here)
    return variance * (ratio * ratio - 1.0)
