"""Turning points and poles that no polynomial gives: sign changes on a fine grid."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import CurveParameters
from simulator.compiled import compiled

__all__ = ["DENOMINATOR", "TURNING", "search_grid", "sign_changes"]

Array = NDArray[np.float64]

# functions whose sign changes are searched for
DENOMINATOR, TURNING = 0, 1

_PER_OCTAVE = 24
_OCTAVES = 60
_LINEAR = 768


@compiled
def _at(function: int, kind: int, p: CurveParameters, u: float) -> float:
    if function == DENOMINATOR:
        denominator, _ = dispatch.direction(kind, u, p)
        return denominator
    return dispatch.turning(kind, u, p)


@compiled
def _crossing(function: int, kind: int, p: CurveParameters, low: float, high: float) -> float:
    """Bisect a sign change."""
    positive = _at(function, kind, p, low) > 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if (_at(function, kind, p, middle) > 0.0) == positive:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def _dip(
    function: int, kind: int, p: CurveParameters, low: float, high: float, sign: float
) -> float:
    """Return where sign * function is least between two points (golden section), or < 0."""
    share = 0.3819660112501051
    a, b = low, high
    x, y = a + share * (b - a), b - share * (b - a)
    fx, fy = sign * _at(function, kind, p, x), sign * _at(function, kind, p, y)
    for _ in range(60):
        if fx < fy:
            b, y, fy = y, x, fx
            x = a + share * (b - a)
            fx = sign * _at(function, kind, p, x)
        else:
            a, x, fx = x, y, fy
            y = b - share * (b - a)
            fy = sign * _at(function, kind, p, y)
        if fx <= 0.0 or fy <= 0.0 or b - a < 1e-12 * b:
            break
    return x if fx < fy else y


def search_grid(p: CurveParameters, low: float, high: float) -> Array:
    """Return points even in the logarithm, even in the range, and dense near both sqrt(c0).

    Parameters
    ----------
    p : CurveParameters
        The curve's parameters.
    low, high : float
        The interval that is searched.
    """
    octaves = min(_OCTAVES, math.log2(high / low))
    log = high * 2.0 ** -np.linspace(0.0, octaves, round(octaves * _PER_OCTAVE) + 2)
    near = [np.sqrt(p.c0) * np.linspace(0.5, 2.0, 256)]
    near += [np.sqrt(p.c0_shadow) * np.linspace(0.5, 2.0, 256)]
    grid = np.concatenate([log, np.linspace(low, high, _LINEAR), *near])
    return np.unique(grid[(grid >= low) & (grid <= high)])


@compiled
def sign_changes(function: int, kind: int, p: CurveParameters, grid: Array) -> Array:
    """Find the zeros of a smooth function: sign changes on a grid, and dips that touch zero.

    Parameters
    ----------
    function : int
        `DENOMINATOR` or `TURNING`.
    kind : int
        The curve.
    p : CurveParameters
        Its parameters.
    grid : ndarray, shape (m,)
        Ascending.

    Returns
    -------
    ndarray
        The zeros, ascending but for rounding.
    """
    values = np.empty(grid.size)
    for i in range(grid.size):
        values[i] = _at(function, kind, p, grid[i])
    found = np.empty(2 * grid.size)
    count = 0
    for i in range(grid.size - 1):
        positive = values[i] > 0.0
        if (values[i + 1] > 0.0) != positive:
            found[count] = _crossing(function, kind, p, grid[i], grid[i + 1])
            count += 1
            continue
        if i == 0 or (values[i - 1] > 0.0) != positive:
            continue
        size = abs(values[i])
        if size <= abs(values[i - 1]) and size <= abs(values[i + 1]):
            low, high = grid[i - 1], grid[i + 1]
            bottom = _dip(function, kind, p, low, high, 1.0 if positive else -1.0)
            if (_at(function, kind, p, bottom) > 0.0) != positive:
                found[count] = _crossing(function, kind, p, low, bottom)
                found[count + 1] = _crossing(function, kind, p, bottom, high)
                count += 2
    return found[:count]
