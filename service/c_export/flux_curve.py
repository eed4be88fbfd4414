"""Curves of an object's light that fall with the range, with bounds that hold by monotony.

K (1 - r / R) / (r^p Q), Q = r^2 + c1 r + c0: the whole light (p = 2, R infinite), the late window
(p = 1), and what is free of a background at R (p = 2).
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["FluxCurve", "Table", "table"]

Array = NDArray[np.float64]

_SUBDIVISION = 16  # of a cell, where its error is bounded
_MOST_NODES = 1 << 16


@dataclasses.dataclass(frozen=True, slots=True)
class FluxCurve:
    """One curve.

    Attributes
    ----------
    strength : float
        K [reading units m^(p + 2)].
    power : int
        p.
    c0, c1 : float
        Of the object [m^2], [m].
    nearness : float
        1 / R [1/m]; 0 without a background.
    """

    strength: float
    power: int
    c0: float
    c1: float
    nearness: float = 0.0

    def value(self, r: Array) -> Array:
        """Return the reading at a range [m]."""
        return self._bare(r) * (1.0 - r * self.nearness)

    def _bare(self, r: Array) -> Array:
        # without cancellation: Q = (r + c1/2)^2 + c0 - c1^2/4 is a sum of squares
        q = (r + self.c1 / 2) ** 2 + (self.c0 - self.c1**2 / 4)
        return np.asarray(self.strength / (r**self.power * q))

    def _slopes(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return least and greatest p + r (2 r + c1) / Q on intervals.

        It turns only where s t^2 + 4 t + s = 0 with t = r / sqrt(c0), s = c1 / sqrt(c0), so that
        ends and turning points have its extremes.
        """
        size = math.sqrt(self.c0)
        s = self.c1 / size

        def at(r: Array) -> Array:
            t = r / size
            return np.asarray(self.power + t * (2 * t + s) / ((t + s / 2) ** 2 + (1 - s * s / 4)))

        ends = at(low), at(high)
        least, greatest = np.minimum(*ends), np.maximum(*ends)
        if s != 0.0:
            root = math.sqrt(max(4.0 - s * s, 0.0))
            for turn in ((-2 + root) / s * size, (-2 - root) / s * size):
                inside = (low < turn) & (turn < high)
                value = at(np.array(max(turn, 0.0)))
                least = np.where(inside, np.minimum(least, value), least)
                greatest = np.where(inside, np.maximum(greatest, value), greatest)
        return least, greatest

    def least_slope(self, low: float, high: float) -> float:
        """Return the least -d log / d log r of the light without a background on an interval.

        Where it is positive the curve falls everywhere on it.
        """
        least, _ = self._slopes(np.array([low]), np.array([high]))
        return float(least[0])

    def falls(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return bounds of -d value / d r on intervals on which it falls [reading units / m]."""
        least, greatest = self._slopes(low, high)
        left = 1.0 - low * self.nearness, 1.0 - high * self.nearness
        return (
            self._bare(high) * (self.nearness + left[1] * least / high),
            self._bare(low) * (self.nearness + left[0] * greatest / low),
        )

    @property
    def condition(self) -> float:
        """Largest (r^2 + |c1| r + c0) / Q: what rounding of Q may be amplified by."""
        s = self.c1 / math.sqrt(self.c0)
        return 1.0 if s >= 0 else (2 - s) / (2 + s)


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """Nodes of a curve, between which ranges are linear in the reading.

    Attributes
    ----------
    range_m, reading : ndarray, shape (n,)
        Nodes, the readings falling.
    error_m, relative : float
        Largest error of a range, and of one relative to it.
    """

    range_m: Array
    reading: Array
    error_m: float
    relative: float


def table(curve: FluxCurve, low: float, high: float, tolerance: float) -> Table | None:
    """Return the smallest table, of a power of two of cells, whose error is proven to be small.

    On a piece [a, b] of a cell the error e of the interpolation changes with the reading at the
    rate 1 / f'(r) - (slope of the cell), which lies between bounds of `FluxCurve.falls`; so |e| is
    at most the larger of |e(a)| and |e(b)| plus half the piece times the largest such rate.

    Parameters
    ----------
    curve : FluxCurve
        The curve, which falls on the whole of it.
    low, high : float
        Ends of the range [m].
    tolerance : float
        Largest error relative to the range.

    Returns
    -------
    Table or None
        None where more than 65536 cells would be needed.
    """
    cells = 16
    while cells <= _MOST_NODES:
        nodes = np.geomspace(low, high, cells + 1)
        reading = curve.value(nodes)
        share = np.arange(_SUBDIVISION + 1) / _SUBDIVISION
        pieces = nodes[:-1, None] + np.diff(nodes)[:, None] * share
        pieces[:, -1] = nodes[1:]
        at = curve.value(pieces)
        rate = np.diff(nodes) / np.diff(reading)
        error = np.abs(nodes[:-1, None] + (at - reading[:-1, None]) * rate[:, None] - pieces)
        least, greatest = curve.falls(pieces[:, :-1], pieces[:, 1:])
        off = np.maximum(np.abs(-1 / least - rate[:, None]), np.abs(-1 / greatest - rate[:, None]))
        bound = np.maximum(error[:, :-1], error[:, 1:]) - 0.5 * np.diff(at, axis=1) * off
        # these lines are rounded themselves
        bound += 64 * np.finfo(float).eps * pieces[:, 1:]
        relative = float((bound / pieces[:, :-1]).max())
        if relative <= tolerance:
            return Table(nodes, reading, float(bound.max()), relative)
        cells *= 2
    return None
