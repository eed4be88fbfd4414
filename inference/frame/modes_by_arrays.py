"""What the interpreter runs in the place of two kernels of `inference.frame.modes`.

Their loops over knots are most of its time; as arithmetic and comparisons of arrays they give the
same bits. Names, arguments and results are those of the kernels.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame.modes import _KNOT, LEFT, POSITION, RIGHT, TOP
from inference.frame.table import MEAN_1, MEAN_2

__all__ = ["_scan", "_tops"]

Array = NDArray[np.float64]


def _scan(
    values: Array,
    before: Array,
    table: Array,
    frame: Any,
    scene: Any,
    shot: float | None,
    relative: float | None,
) -> Any:
    """Fill log densities at every knot where noise is that of readings alone."""
    if shot is not None or relative is not None or frame.known is not None:
        return NotImplemented
    c1, c2 = scene.crosstalk or (0.0, 0.0)
    read, gain = scene.instrument.read, frame.gain
    e1 = (frame.first - c1 - gain * table[MEAN_1]) * (1.0 / read[0])
    e2 = (frame.second - c2 - gain * table[MEAN_2]) * (1.0 / read[1])
    values[:] = before - 0.5 * (e1 * e1 + e2 * e2)
    return None


def _tops(modes: Array, values: Array, knots: Array) -> int:
    """Fill knot, value and interval of every local maximum of the values; count them."""
    n = values.size
    top = np.ones(n, dtype=bool)
    top[1:] = values[1:] > values[:-1]
    top[:-1] &= values[:-1] >= values[1:]
    last = 0
    found = np.flatnonzero(top)
    for count, k in enumerate(found):
        since = values[last : k + 1]
        # nothing is less than nan, and nan less than nothing
        valley = last if np.isnan(since[0]) else last + np.nanargmin(since)
        modes[count, POSITION], modes[count, TOP], modes[count, _KNOT] = knots[k], values[k], k
        modes[count, LEFT], modes[count, RIGHT] = knots[valley], knots[n - 1]
        if count == 0:
            modes[count, LEFT] = knots[0]
        else:
            modes[count - 1, RIGHT] = knots[valley]
        last = int(k)
    return int(found.size)
