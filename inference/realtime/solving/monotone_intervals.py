"""Monotone pieces of a curve: the proof that every root is found, and found once.

A curve has at most one root in each interval between two neighbouring turning points (or poles).
Turning points are roots of polynomials of degree 2 to 4, of the differential phase for background
cancelling of a sine wave, and sign changes on a fine grid for the two curves of a derivative with
background (errata, section 5).
"""

import dataclasses
import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.curves import (
    BOTH_PHASE,
    BOTH_RATIO,
    C0,
    C0_SHADOW,
    C1,
    C1_SHADOW,
    CANCELLING_RATIO,
    CONTRAST,
    DIFFERENTIAL_PHASE,
    DIFFERENTIAL_RATIO,
    DISTANCE,
    INTENSITY,
    INTENSITY_W1,
    WAVE,
    direction,
    turning,
    value,
)
from inference.realtime.solving.invert import invert
from inference.realtime.solving.polynomials import real_roots
from simulator.compiled import compiled

__all__ = ["LEAST", "Pieces", "pieces_of"]

Array = NDArray[np.float64]

LEAST = 2.0**-330  # stands for zero range: its square is still a normal number
_PER_OCTAVE = 24
_OCTAVES = 60
_LINEAR = 768


@dataclasses.dataclass(frozen=True, eq=False)
class Pieces:
    """Monotone pieces of a curve, ascending.

    Attributes
    ----------
    ends : ndarray, shape (k, 2)
        Ends of the pieces.
    values : ndarray, shape (k, 2)
        The curve's values there; infinite at a pole, unwrapped for an angle.
    folds : ndarray of bool, shape (k, 2)
        Whether the end is a turning point.
    """

    ends: Array
    values: Array
    folds: NDArray[np.bool_]


def pieces_of(kind: int, p: Array, low: float, high: float) -> Pieces:
    """Part an interval into monotone pieces.

    Parameters
    ----------
    kind : int
        The curve.
    p : ndarray
        Its parameters.
    low, high : float
        The interval, 0 <= low < high; an infinite end is moved to where the curve has vanished.

    Returns
    -------
    Pieces
        The pieces.
    """
    low = max(low, LEAST)
    high = min(high, 1.0 / LEAST)
    if kind in (BOTH_RATIO, BOTH_PHASE):
        turns, poles = _scanned(kind, p, low, high)
    else:
        turns, poles = _solved(kind, p, low, high)
    marks = sorted({*turns, *poles} - {low, high})
    points = np.array([low, *marks, high])
    ends = np.column_stack([points[:-1], points[1:]])
    folds = np.isin(ends, turns)
    if kind == BOTH_PHASE:
        return _unwrapped(p, points, turns)
    at = _exact_ratio if kind in (DIFFERENTIAL_RATIO, BOTH_RATIO) else value
    values = np.array([[at(kind, u, p) for u in pair] for pair in ends.tolist()])
    for i, (left, right) in enumerate(ends.tolist()):
        inside = direction(kind, math.sqrt(left) * math.sqrt(right), p)[0] if poles else 0.0
        for side, end in enumerate((left, right)):
            if end in poles:
                numerator = direction(kind, end, p)[1]
                values[i, side] = math.copysign(math.inf, numerator * math.copysign(1.0, inside))
    return Pieces(ends, values, folds)


def _exact_ratio(kind: int, u: float, p: Array) -> float:
    """Evaluate a ratio exactly: at a turning point its value decides how many roots there are."""
    r, c0, c1, far, c0s, c1s, contrast = (
        Fraction(float(x))
        for x in (u, p[C0], p[C1], p[DISTANCE], p[C0_SHADOW], p[C1_SHADOW], p[CONTRAST])
    )
    q = r * (r + c1) + c0
    # numerator and denominator of d(r Phi + R Phi_bg) / d(Phi + Phi_bg), times r^3 Q^2 / c0
    top, bottom = -r * (3 * r * r + 2 * c1 * r + c0), -(4 * r * r + 3 * c1 * r + 2 * c0)
    if kind == BOTH_RATIO:
        rate = contrast / c0 * c0s * (2 * r + c1s) * r**3 * (q / (r * (r + c1s) + c0s)) ** 2
        top, bottom = top + far * rate, bottom + rate
    return float(top / bottom) if bottom else math.inf


def _roots(coefficients: tuple[float, ...], low: float, high: float) -> list[float]:
    found = np.empty(len(coefficients))
    count = real_roots(np.array(coefficients), low, high, found)
    return [float(root) for root in found[:count]]


def _solved(kind: int, p: Array, low: float, high: float) -> tuple[list[float], list[float]]:
    """Solve for turning points and poles (errata, 4.1, 4.4, 4.68, 5)."""
    c0, c1, distance, k = (float(p[place]) for place in (C0, C1, DISTANCE, WAVE))
    log_slope = (4.0, 3.0 * c1, 2.0 * c0)
    if kind == INTENSITY:
        return _roots(log_slope, low, high), []
    if kind == INTENSITY_W1:
        return _roots((3.0, 2.0 * c1, c0), low, high), []
    if kind == DIFFERENTIAL_RATIO:
        return _roots((6.0, 3.0 * c1, c0), low, high), _roots(log_slope, low, high)
    if kind == CANCELLING_RATIO:
        cubic = (
            -3.0,
            4.0 * distance - 2.0 * c1,
            3.0 * c1 * distance - c0,
            2.0 * c0 * distance,
        )
        return _roots(cubic, low, high), []
    quartic = (k * k, k * k * c1, k * k * c0 + 12.0, 6.0 * c1, 2.0 * c0)
    bends = _roots(quartic, low, high)
    if kind == DIFFERENTIAL_PHASE:
        return bends, []
    # m = Phi sin(k (R - r)) turns where the differential phase is k R modulo pi
    points = np.array([low, *bends, high])
    ends = np.column_stack([points[:-1], points[1:]])
    values = np.array([[value(DIFFERENTIAL_PHASE, u, p) for u in pair] for pair in ends.tolist()])
    target = np.array([math.fmod(k * distance, math.pi)])
    found = invert(
        DIFFERENTIAL_PHASE, target, np.ones(1), p, ends, values, np.zeros(ends.shape, bool), math.pi
    )[0][0]
    return [float(u) for u in found[np.isfinite(found)]], []


@compiled
def _scan(function: int, kind: int, p: Array, grid: Array) -> Array:
    """Return the denominator (0) or the turning function (1) on a grid."""
    out = np.empty(grid.size)
    for i in range(grid.size):
        out[i] = direction(kind, grid[i], p)[0] if function == 0 else turning(kind, grid[i], p)
    return out


@compiled
def _one(function: int, kind: int, p: Array, u: float) -> float:
    return direction(kind, u, p)[0] if function == 0 else turning(kind, u, p)


@compiled
def _crossing(function: int, kind: int, p: Array, low: float, high: float) -> float:
    """Bisect a sign change."""
    positive = _one(function, kind, p, low) > 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if (_one(function, kind, p, middle) > 0.0) == positive:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def _dip(function: int, kind: int, p: Array, low: float, high: float, sign: float) -> float:
    """Return where sign * function is least between two points (golden section), or < 0."""
    share = 0.3819660112501051
    a, b = low, high
    x, y = a + share * (b - a), b - share * (b - a)
    fx, fy = sign * _one(function, kind, p, x), sign * _one(function, kind, p, y)
    for _ in range(60):
        if fx < fy:
            b, y, fy = y, x, fx
            x = a + share * (b - a)
            fx = sign * _one(function, kind, p, x)
        else:
            a, x, fx = x, y, fy
            y = b - share * (b - a)
            fy = sign * _one(function, kind, p, y)
        if fx <= 0.0 or fy <= 0.0 or b - a < 1e-12 * b:
            break
    return x if fx < fy else y


def _sign_changes(function: int, kind: int, p: Array, grid: Array) -> list[float]:
    """Find the zeros of a smooth function: sign changes on a grid, and dips that touch zero."""
    values = _scan(function, kind, p, grid)
    positive = values > 0.0
    found = [
        _crossing(function, kind, p, float(grid[i]), float(grid[i + 1]))
        for i in np.flatnonzero(positive[1:] != positive[:-1])
    ]
    size = np.abs(values)
    dips = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    dips &= (positive[1:-1] == positive[:-2]) & (positive[1:-1] == positive[2:])
    for i in np.flatnonzero(dips) + 1:
        sign = 1.0 if positive[i] else -1.0
        low, high = float(grid[i - 1]), float(grid[i + 1])
        bottom = _dip(function, kind, p, low, high, sign)
        if (_one(function, kind, p, bottom) > 0.0) != positive[i]:
            found += [
                _crossing(function, kind, p, low, bottom),
                _crossing(function, kind, p, bottom, high),
            ]
    return found


def _scanned(kind: int, p: Array, low: float, high: float) -> tuple[list[float], list[float]]:
    """Search turning points and poles of the curves of a derivative with background."""
    octaves = min(_OCTAVES, math.log2(high / low))
    log = high * 2.0 ** -np.linspace(0.0, octaves, round(octaves * _PER_OCTAVE) + 2)
    near = [np.sqrt(p[C0]) * np.linspace(0.5, 2.0, 256)]
    near += [np.sqrt(p[C0_SHADOW]) * np.linspace(0.5, 2.0, 256)]
    grid = np.concatenate([log, np.linspace(low, high, _LINEAR), *near])
    grid = np.unique(grid[(grid >= low) & (grid <= high)])
    turns = _sign_changes(1, kind, p, grid)
    poles = _sign_changes(0, kind, p, grid) if kind == BOTH_RATIO else []
    return turns, poles


def _unwrapped(p: Array, points: Array, turns: list[float]) -> Pieces:
    """Pieces of an angle: cut so finely that it turns by less than a right angle in each."""
    grid: list[float] = [float(points[0])]
    for left, right in zip(points[:-1].tolist(), points[1:].tolist(), strict=True):
        stack = [(left, right, 0)]
        while stack:
            a, b, depth = stack.pop()
            middle = 0.5 * (a + b) if b < 4.0 * a else math.sqrt(a) * math.sqrt(b)
            first, second, third = (value(BOTH_PHASE, u, p) for u in (a, middle, b))
            steps = (_wrapped(second - first), _wrapped(third - second))
            wide = max(abs(steps[0]), abs(steps[1])) > 0.24 * math.pi or steps[0] * steps[1] < 0.0
            if (wide or depth < 1) and depth < 60 and a < middle < b:
                stack += [(middle, b, depth + 1), (a, middle, depth + 1)]
            else:
                grid.append(b)
    angles = np.unwrap([value(BOTH_PHASE, u, p) for u in grid])
    # the object's own derivative points away from its phase: modulo pi the branch starts at zero
    angles -= math.pi * round(angles[0] / math.pi)
    nodes = np.array(grid)
    ends = np.column_stack([nodes[:-1], nodes[1:]])
    return Pieces(ends, np.column_stack([angles[:-1], angles[1:]]), np.isin(ends, turns))


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
