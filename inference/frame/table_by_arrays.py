"""What the interpreter runs in the place of kernels of `inference.frame.table`: the same bits."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame import table as loops
from inference.frame.arguments import FrameScene, Instrument
from inference.frame.light_by_arrays import NotByArraysError, information, light, of_each
from inference.frame.range_prior import LEAST_INFORMATION, log_range_density
from inference.frame.table import (
    KNOT_SPACING,
    LOG_PRIOR,
    LOG_RANGE,
    MEAN_1,
    MEAN_2,
    SIGNAL_1,
    SIGNAL_2,
    TURN,
)
from simulator.uncompiled import twin

__all__ = ["_too_coarse", "tabulate"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
_LEAST = loops._VISIBLE * loops._VISIBLE


def _changes_sign(values: Array, unit: float) -> Flags:
    """Tell which steps change the sign of a quantity, and are visible."""
    below = values < 0.0
    return np.asarray((below[:-1] != below[1:]) & (abs(values[1:] - values[:-1]) > unit))


def _too_coarse(
    split: Flags, table: Array, offset: Any, unit: Any, pulsed: bool, shot: float | None
) -> int:
    """Mark the segments of a table that want a knot in their middle; count them."""
    x = (table[MEAN_1, 1:] - table[MEAN_1, :-1]) / unit[0]
    y = (table[MEAN_2, 1:] - table[MEAN_2, :-1]) / unit[1]
    length = x * x + y * y
    before, after = length[:-1], length[1:]
    along = x[:-1] * x[1:] + y[:-1] * y[1:]
    turns = (along <= 0.0) | (along * along < TURN * TURN * before * after)
    turns &= np.where(after > before, after, before) > _LEAST
    split[:] = False
    split[:-1] |= turns
    split[1:] |= turns
    split &= length > _LEAST
    if shot:
        a, b = table[MEAN_1] + offset[0], table[MEAN_2] + offset[1]
        split |= _changes_sign(a, unit[0]) | _changes_sign(b, unit[1])
        if pulsed:
            split |= _changes_sign(a - b, min(unit[0], unit[1]))
    u = table[LOG_RANGE]
    split &= u[1:] - u[:-1] > 1e-12 * (1.0 + abs(u[:-1]))
    return int(np.count_nonzero(split))


def _columns(u: Array, strongest: float, scene: FrameScene) -> Array:
    """Return columns of a table."""
    r, prior = of_each(math.exp, u), scene.range_prior
    columns = np.empty((loops._ROWS, u.size))
    columns[LOG_RANGE] = u
    columns[LOG_PRIOR] = twin(log_range_density)(r, u, prior)
    if prior.resolves:
        total = information(r, strongest, scene)
        total = np.where(total < 0.0, 0.0, total)
        told = total / LEAST_INFORMATION
        columns[LOG_PRIOR] += of_each(math.log, (told + prior.dark) / np.sqrt(1.0 + told))
    signal, mean = light(r, scene)
    columns[SIGNAL_1], columns[SIGNAL_2] = signal
    columns[MEAN_1], columns[MEAN_2] = mean
    return columns


def tabulate(bounds: Any, scene: Any, strongest: float) -> Any:
    """Tabulate the curve of mean readings, knots closer where it turns."""
    r0, wave, read, shot, _, _ = scene.instrument
    plain = scene._replace(instrument=Instrument(r0, wave, read, shot, None, False), offset=None)
    n = max(loops._FEWEST_KNOTS, math.ceil((bounds[1] - bounds[0]) / KNOT_SPACING) + 1)
    unit = (read[0] / strongest, read[1] / strongest)
    offset = twin(loops._offset)(scene.crosstalk, strongest)
    try:
        table = _columns(
            bounds[0] + (bounds[1] - bounds[0]) * np.arange(n) / (n - 1), strongest, plain
        )
        while True:
            split = np.empty(n - 1, dtype=np.bool_)
            more = _too_coarse(split, table, offset, unit, wave is None, shot)
            if more == 0 or n + more > loops._MOST_KNOTS:
                return table
            at = np.flatnonzero(split)
            middle = 0.5 * (table[LOG_RANGE, at] + table[LOG_RANGE, at + 1])
            table = np.insert(table, at + 1, _columns(middle, strongest, plain), axis=1)
            n += more
    except NotByArraysError:
        return NotImplemented
