"""Where along the curve a frame can lie: places to look from, and a bound of what a place holds."""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import WITHOUT_CROSSTALK
from inference.tracking.readings_table import ReadingsTable
from simulator.compiled import compiled

__all__ = ["Places", "Scan", "boxes_of", "mass_bound"]

Array = NDArray[np.float64]

_GROUP = 16  # boxes
_UNSEEN = 120.0  # square of the distance beyond which a box holds nothing of a density
_LEAST_SPEED = 0.7  # of the least speed at knots: between them it may be less
# columns of a box
_LOW1, _HIGH1, _LOW2, _HIGH2, _SPREAD, _PROBABILITY, _MOST, _LEAST1, _LEAST2 = range(9)


class Scan(NamedTuple):
    """Places along the curve between which it is near straight."""

    positions: Array  # (s,): their log ranges, ascending, both ends of the table among them
    next_one: NDArray[np.int64]  # (knots,): index of the first of them at or after each knot


class Places(NamedTuple):
    """What goes with a table of readings, and is needed once a frame."""

    scan: Scan  # where to look from
    # (2, 1 + p): readings of the empty scene without crosstalk, and their change with the nuisance
    # parameters
    empty: Array
    # (s - 1, 9): of every stretch between two places: least and greatest first and second reading,
    # the most that nuisance parameters add to any direction of them, its prior probability, a
    # bound of what it holds of any frame's density, and the least diagonal of the root of what
    # nuisance parameters add
    boxes: Array
    groups: Array  # (g, 5): boxes around every 16 boxes, and the most that is added there


@compiled
def _gap(value: float, low: float, high: float) -> float:
    """Return the distance of a value from an interval."""
    return max(low - value, value - high, 0.0)


@compiled
def _square_gap(y1: float, y2: float, boxes: Array, j: int) -> float:
    """Return the square of the distance of two readings from a box."""
    d1 = _gap(y1, boxes[j, _LOW1], boxes[j, _HIGH1])
    d2 = _gap(y2, boxes[j, _LOW2], boxes[j, _HIGH2])
    return d1 * d1 + d2 * d2


@compiled
def mass_bound(frame: TrackedFrame, states: int, table: ReadingsTable, places: Places) -> float:
    """Return an upper bound of a frame's density averaged over the prior of the ranges.

    A stretch of the curve lies in a box, and no reading is nearer to it than to the box; on a
    stretch whose every piece advances along its chord the density integrates to at most
    sqrt(2 pi) over the least speed. Nuisance parameters with the root R add R R^T to the covariance
    I: no direction is wider than by the norm of R, and the determinant is at least the product of
    1 + r^2 over the diagonal. Where crosstalk is learnt or the noise depends on the range only that
    no density exceeds its top is used.

    Parameters
    ----------
    frame : TrackedFrame
        The frame.
    states : int
        Of a hypothesis: more than 2 where crosstalk is learnt.
    table, places : ReadingsTable, Places
        The scene.
    """
    if not table.noise.plain or table.by_rate or states > WITHOUT_CROSSTALK:
        return 1.0
    gain = frame.gain
    y1, y2 = (frame.first - table.crosstalk1) / gain, (frame.second - table.crosstalk2) / gain
    total, square_gain = 0.0, gain * gain
    groups, boxes = places.groups, places.boxes
    for g in range(groups.shape[0]):
        narrowest = square_gain / (1.0 + square_gain * groups[g, _SPREAD])
        if _square_gap(y1, y2, groups, g) * narrowest > _UNSEEN:
            continue
        for j in range(g * _GROUP, min((g + 1) * _GROUP, boxes.shape[0])):
            spread = square_gain * boxes[j, _SPREAD]
            square = _square_gap(y1, y2, boxes, j) * square_gain / (1.0 + spread)
            if square <= _UNSEEN:
                near = boxes[j, _PROBABILITY] * math.exp(-0.5 * square)
                if spread > 0.0:
                    least1, least2 = gain * boxes[j, _LEAST1], gain * boxes[j, _LEAST2]
                    near /= math.sqrt((1.0 + least1 * least1) * (1.0 + least2 * least2))
                    total += near
                else:
                    total += min(near, boxes[j, _MOST] / gain)
    return total + math.exp(-0.5 * _UNSEEN)


def boxes_of(
    positions: Array, means: Array, log_prior: Array, roots: Array, scan: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the boxes and groups of `Places`.

    Parameters
    ----------
    positions : ndarray, shape (knots,)
        u = log r.
    means : ndarray, shape (knots, at least 4)
        Mean readings in units of the noise, and their derivatives along u.
    log_prior : ndarray, shape (knots,)
        Log prior density of u.
    roots : ndarray, shape (knots, 3)
        r11, r21, r22 of the root of the covariance that nuisance parameters add; straight between
        knots, so that its norm is nowhere above that at a knot, nor its diagonal below.
    scan : ndarray of int, shape (s,)
        Indices of the knots between which the curve is near straight, ascending.
    """
    norms = np.square(np.linalg.norm(_matrices(roots), ord=2, axis=(1, 2)))
    boxes = np.empty((scan.size - 1, _LEAST2 + 1))
    for j, (a, b) in enumerate(itertools.pairwise(scan)):
        curve, slopes = means[a : b + 1, :2], means[a : b + 1, 2:4]
        low, high = curve.min(axis=0), curve.max(axis=0)
        # the curve may leave the box of its knots a little
        margin = 0.05 + 0.05 * (high - low)
        boxes[j, :_SPREAD] = np.column_stack([low - margin, high + margin]).ravel()
        width = positions[b] - positions[a]
        top = math.exp(log_prior[a : b + 1].max())
        chord = curve[-1] - curve[0]
        length = float(np.linalg.norm(chord))
        slowest = float((slopes @ chord).min()) / length if length > 0.0 else 0.0
        boxes[j, _PROBABILITY] = top * width
        # of a sensor with more gain the curve is faster, and what it takes up as much less
        speed = _LEAST_SPEED * slowest
        boxes[j, _MOST] = top * math.sqrt(2.0 * math.pi) / speed if speed > 0.0 else math.inf
        boxes[j, _SPREAD] = norms[a : b + 1].max()
        boxes[j, [_LEAST1, _LEAST2]] = roots[a : b + 1, [0, 2]].min(axis=0)
    firsts = np.arange(0, boxes.shape[0], _GROUP)
    lows = np.minimum.reduceat(boxes[:, [_LOW1, _LOW2]], firsts)
    highs = np.maximum.reduceat(boxes[:, [_HIGH1, _HIGH2]], firsts)
    spreads = np.maximum.reduceat(boxes[:, _SPREAD], firsts)
    around = np.stack([lows, highs], axis=2).reshape(-1, _SPREAD)
    return boxes, np.column_stack([around, spreads])


def _matrices(roots: Array) -> Array:
    """Return triangular matrices, shape (n, 2, 2), of r11, r21, r22."""
    lower = np.zeros((len(roots), 2, 2))
    lower[:, 0, 0], lower[:, 1, 0], lower[:, 1, 1] = roots.T
    return lower
