"""Integrals of narrow peaks along many lines at a time, which look for their peaks themselves.

A line's log height is seen on a grid that takes in all of a prior; every local maximum of it is
followed down to the scale on which the height falls by a nat, however narrow, and panels that
double away from there take in all that counts. Two rules on the same panels tell the error.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Heights", "Nodes", "Tops", "integrated", "laplace", "tops_of"]

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Heights = Callable[[Numbers, Array], Array]
"""Log heights at places, shape (n,), of lines of given numbers, shape (n,)."""

_END = 2 * np.sinh(3.0)  # 20 standard deviations of a prior
_MOST_TOPS = 10
_DROP = 2.0  # nat, to which a bracket is narrowed
_NEGLIGIBLE = 40.0  # nat
_STEPS = 60
_TOLERANCE = 5e-3  # of a line's mass, by which two rules may differ in all of its panels
_ROUNDS = 10
# Gauss-Kronrod, 3 and 7 points
_X = np.array([0.960491268708020, 0.774596669241483, 0.434243749346802])
_PLACES = np.concatenate([-_X, [0.0], _X[::-1]])
_K = np.array([0.104656226026467, 0.268488089868333, 0.401397414775962, 0.450916538658474])
_FINE = np.concatenate([_K, _K[2::-1]])
_COARSE = np.array([0, 5 / 9, 0, 8 / 9, 0, 5 / 9, 0])


class Tops(NamedTuple):
    """Local maxima of lines, each between two places where the height is less by a nat or two.

    Attributes
    ----------
    line : ndarray of int, shape (m,)
        Which line each is of.
    place, height : ndarray, shape (m, 3)
        Left of it, at it, right of it; the same as at it where the line ends there.
    """

    line: Numbers
    place: Array
    height: Array

    def of(self, which: NDArray[np.bool_] | Numbers) -> "Tops":
        """Return some of them."""
        return Tops(self.line[which], self.place[which], self.height[which])

    @property
    def widths(self) -> Array:
        """Where the height is less by half a nat, left and right, shape (m, 2); 0 at an end."""
        away = np.abs(self.place[:, [0, 2]] - self.place[:, [1]])
        fall = np.clip(self.height[:, [1]] - self.height[:, [0, 2]], 0.02, None)
        return np.asarray(away / np.sqrt(2 * fall))


class Nodes(NamedTuple):
    """A quadrature of lines: logarithms of weights times heights, by a fine and a coarse rule."""

    line: Numbers
    place: Array
    fine: Array
    coarse: Array


def _best(n: int, tops: Tops) -> Array:
    best = np.full(n, -np.inf)
    np.maximum.at(best, tops.line, tops.height[:, 1])
    return best


def tops_of(heights: Heights, n: int, points: int) -> Tops:
    """Find the local maxima of n lines that come within 40 nat of each line's highest.

    Parameters
    ----------
    heights : callable
        Log heights.
    n : int
        Lines.
    points : int
        Of the grid on which they are looked for: denser about the middle of the prior.

    Returns
    -------
    Tops
    """
    grid = 2 * np.sinh(np.linspace(-3.0, 3.0, points))
    line = np.repeat(np.arange(n), points)
    seen = heights(line, np.tile(grid, n)).reshape(n, -1)
    padded = np.pad(seen, ((0, 0), (1, 1)), constant_values=-np.inf)
    local = (seen > -np.inf) & (seen >= padded[:, :-2]) & (seen > padded[:, 2:])
    of, at = np.nonzero(local)
    order = np.lexsort((-seen[of, at], of))
    of, at = of[order], at[order]
    rank = np.arange(len(of)) - np.searchsorted(of, of)
    few = rank < _MOST_TOPS
    of, at = of[few], at[few]
    about = np.clip(at[:, None] + [-1, 0, 1], 0, points - 1)
    tops = Tops(of, grid[about], seen[of[:, None], about])
    for _ in range(_STEPS):
        fall = tops.height[:, 1] - tops.height[:, [0, 2]].min(axis=1)
        high = tops.height[:, 1] > _best(n, tops)[tops.line] - 100 - 10 * fall
        tops, fall = tops.of(high), fall[high]
        width = tops.place[:, 2] - tops.place[:, 0]
        wide = (fall > _DROP) & (width > 1e-15 * (1 + np.abs(tops.place[:, 1])))
        if not wide.any():
            break
        narrowed = _narrowed(heights, tops.of(wide))
        tops.place[wide], tops.height[wide] = narrowed.place, narrowed.height
    return tops.of(tops.height[:, 1] > _best(n, tops)[tops.line] - _NEGLIGIBLE)


def _narrowed(heights: Heights, tops: Tops) -> Tops:
    """Look at halves, at a parabola's top and a nat below it on either side."""
    a, b, c = tops.place.T
    with np.errstate(all="ignore"):
        left, right = (tops.height[:, [0, 2]] - tops.height[:, [1]]).T / np.array([a - b, c - b])
        bend = 2 * (left - right) / (a - c)
        step = -(left - bend * (a - b) / 2) / bend
        nat = np.sqrt(2 / np.abs(bend))
    new = b[:, None] + np.column_stack([step, step - nat, step + nat, (a - b) / 2, (c - b) / 2])
    new = np.where((new > a[:, None]) & (new < c[:, None]), new, b[:, None])
    moved = new != b[:, None]
    found = np.full(new.shape, -np.inf)
    line = np.broadcast_to(tops.line[:, None], new.shape)
    found[moved] = heights(line[moved], new[moved])
    place = np.column_stack([tops.place, new])
    height = np.column_stack([tops.height, np.where(moved, found, tops.height[:, [1]])])
    every = np.arange(len(place))
    top = height.argmax(axis=1)
    at = place[every, top]
    before = np.where(place < at[:, None], place, -np.inf).argmax(axis=1)
    after = np.where(place > at[:, None], place, np.inf).argmin(axis=1)
    before = np.where((place < at[:, None]).any(axis=1), before, top)
    after = np.where((place > at[:, None]).any(axis=1), after, top)
    chosen = np.column_stack([before, top, after])
    return Tops(tops.line, place[every[:, None], chosen], height[every[:, None], chosen])


def laplace(tops: Tops, n: int) -> Array:
    """Return rough log integrals of n lines: heights times widths of their tops."""
    before, after = (tops.place[:, [0, 2]] - tops.place[:, [1]]).T
    with np.errstate(all="ignore"):
        left, right = (tops.height[:, [0, 2]] - tops.height[:, [1]]).T / np.array([before, after])
        bend = -2 * (left - right) / (before - after)
        slope = left + bend * before / 2
        normal = slope**2 / (2 * bend) - 0.5 * np.log(bend)
        skewed = np.log(tops.widths.sum(axis=1) / 2)
    normal = np.where(np.isfinite(normal) & (normal < skewed + 2), normal, skewed)
    each = tops.height[:, 1] + normal + 0.5 * np.log(2 * np.pi)
    out = np.full(n, -np.inf)
    np.logaddexp.at(out, tops.line, each)
    return out


def _panels(heights: Heights, tops: Tops, n: int) -> tuple[Numbers, Array, Array]:
    """Return panels that double away from every top until 40 nat are lost: line, low, high."""
    best = _best(n, tops)[tops.line] - _NEGLIGIBLE
    points: list[tuple[Numbers, Array, Numbers]] = []  # line, place, number of the top
    every = np.arange(len(tops.line))
    points.append((tops.line, tops.place[:, 1], every))
    for side in (0, 1):
        which = every[tops.widths[:, side] > 0]
        step = tops.widths[which, side] * (2 * side - 1)
        while which.size:
            place = np.clip(tops.place[which, 1] + step, -_END, _END)
            points.append((tops.line[which], place, which))
            on = (heights(tops.line[which], place) > best[which]) & (np.abs(place) < _END)
            which, step = which[on], 2 * step[on]
    line, place, top = (np.concatenate(part) for part in zip(*points, strict=True))
    first = np.full(len(every), np.inf)
    last = np.full(len(every), -np.inf)
    np.minimum.at(first, top, place)
    np.maximum.at(last, top, place)
    rows = []
    for k in np.unique(line):
        edges = np.unique(place[line == k])
        low, high = edges[:-1], edges[1:]
        of = tops.line == k
        held = (first[of][:, None] <= low) & (high <= last[of][:, None])
        inside = held.any(axis=0)
        rows.append((np.full(int(inside.sum()), k), low[inside], high[inside]))
    numbers, low, high = (np.concatenate(part) for part in zip(*rows, strict=True))
    return numbers.astype(np.intp), low, high


def integrated(heights: Heights, tops: Tops, n: int) -> Nodes:
    """Integrate n lines over all panels about their tops, halved where two rules differ."""
    if not tops.line.size:
        return Nodes(np.empty(0, np.intp), np.empty(0), np.empty(0), np.empty(0))
    line, low, high = _panels(heights, tops, n)
    settled: list[tuple[Numbers, Array, Array, Array]] = []
    most, total, error = np.full(n, -np.inf), np.zeros(n), np.zeros(n)
    for left in reversed(range(_ROUNDS)):
        half = ((high - low) / 2)[:, None]
        place = (low + high)[:, None] / 2 + half * _PLACES
        seen = heights(np.repeat(line, len(_PLACES)), place.ravel()).reshape(place.shape)
        above = most.copy()
        np.maximum.at(above, line, seen.max(axis=1, initial=-np.inf))
        with np.errstate(invalid="ignore"):
            less = np.where(most > -np.inf, np.exp(most - above), 0.0)
        most, total, error = above, total * less, error * less
        part = np.exp(seen - most[line][:, None]) * half
        mass, off = part @ _FINE, np.abs(part @ (_FINE - _COARSE))
        whole = (total + np.bincount(line, mass, n))[line]
        doubt = (error + np.bincount(line, off, n))[line]
        # the worst panels of lines that are not known well enough yet
        split = (doubt > _TOLERANCE * whole) & (off > 0.05 * doubt) & (left > 0)
        split &= high - low > 1e-14 * (1 + np.abs(low))
        kept = ~split
        total += np.bincount(line[kept], mass[kept], n)
        error += np.bincount(line[kept], off[kept], n)
        with np.errstate(divide="ignore"):
            fine, coarse = seen + np.log(half * _FINE), seen + np.log(half * _COARSE)
        of = np.repeat(line[kept], len(_PLACES))
        settled.append((of, place[kept].ravel(), fine[kept].ravel(), coarse[kept].ravel()))
        line = np.concatenate([line[split], line[split]])
        middle = (low[split] + high[split]) / 2
        low, high = np.concatenate([low[split], middle]), np.concatenate([middle, high[split]])
        if not line.size:
            break
    return Nodes(*(np.concatenate(part) for part in zip(*settled, strict=True)))
