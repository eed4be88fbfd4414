"""What the interpreter runs in the place of kernels of `inference.frame.modes`.

Their loops over knots are most of its time; as arithmetic and comparisons of arrays they give the
same bits. Names, arguments and results are those of the kernels.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame import modes as loops
from inference.frame.blocks import frame_count, frame_of
from inference.frame.light_by_arrays import NotByArraysError, gaussian
from inference.frame.modes import _KNOT, LEFT, POSITION, RIGHT, TOP
from inference.frame.table import LOG_PRIOR, LOG_RANGE, MEAN_1, MEAN_2, SIGNAL_1, SIGNAL_2
from simulator.uncompiled import twin

__all__ = ["_scan", "_tops", "find_modes"]

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
    """Fill log densities at every knot where nothing is known of the frame's range."""
    if frame.known is not None:
        return NotImplemented
    c1, c2 = scene.crosstalk or (0.0, 0.0)
    first, second, gain = frame.first - c1, frame.second - c2, frame.gain
    if shot is None and relative is None:
        read = scene.instrument.read
        e1 = (first - gain * table[MEAN_1]) * (1.0 / read[0])
        e2 = (second - gain * table[MEAN_2]) * (1.0 / read[1])
        values[:] = before - 0.5 * (e1 * e1 + e2 * e2)
        return None
    m1, m2 = gain * table[MEAN_1], gain * table[MEAN_2]
    signal = gain * table[SIGNAL_1], gain * table[SIGNAL_2]
    try:
        values[:] = before + gaussian(
            (first - m1, second - m2), (m1 + c1, m2 + c2), signal, scene.instrument
        )
    except NotByArraysError:
        return NotImplemented
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


def find_modes(modes: Array, values: Array, table: Array, block: Any, scene: Any) -> int:
    """Find the local maxima of the density of a block of frames."""
    shot, relative = scene.instrument.shot, scene.instrument.relative
    scan, refine = twin(loops._scan), twin(loops._refine)
    for j in range(twin(frame_count)(block)):
        before = table[LOG_PRIOR] if j == 0 else values
        scan(values, before, table, twin(frame_of)(block, j), scene, shot, relative)
    if not math.isfinite(np.fmax.reduce(values)):
        return 0
    knots = table[LOG_RANGE]
    count = _tops(modes, values, knots)
    for m in range(count):
        k = int(modes[m, _KNOT])
        lower, upper = knots[max(k - 1, 0)], knots[min(k + 1, values.size - 1)]
        refine(modes[m], lower, upper, block, scene)
    return count
