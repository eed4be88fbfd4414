"""Where a frame and what is known before it agree: all modes along the range, and their mass."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import GLOBALS, Curve, Prior, add_factor, log_density
from inference.tracking.masses import integrate
from inference.tracking.peaks import climb, climb_plain
from simulator.compiled import compiled

__all__ = ["REACH", "find_choices"]

Array = NDArray[np.float64]

REACH = 7.0  # standard deviations of a prediction that are searched


@compiled
def find_choices(
    choices: Array,
    count: int,
    parent: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
    scan: Array,
    next_scan: NDArray[np.int64],
    values: Array,
) -> int:
    """Append every mode of a frame under one prior to a list.

    Parameters
    ----------
    choices : ndarray, shape (capacity, CHOICE_COLUMNS)
        The list; where it is full, its lightest member gives way.
    count : int
        Its length so far.
    parent : float
        What the last column says.
    first, second : float
        Readings in units of the read noise.
    prior, spread, curve
        As for `log_density`.
    scan : ndarray, shape (s,)
        Log ranges between which the curve is near straight, ascending from its start to its end.
    next_scan : ndarray of int, shape (knots,)
        Index of the first of them at or after each knot.
    values : ndarray, shape (at least s + 2, 2)
        Overwritten.

    Returns
    -------
    int
        The new length.
    """
    low, high, width = curve.start, curve.end, curve.end - curve.start
    if not prior.born:
        width = 1.0 / math.sqrt(prior.precision)
        low = max(low, prior.centre - REACH * width)
        high = min(high, prior.centre + REACH * width)
        if not low < high:  # gone beyond the support
            return count
    plain = curve.plain and not curve.by_rate
    linear = spread.shape[1] > 2
    plain = plain and not (prior.born and curve.table.shape[1] > GLOBALS)
    root = add_factor((1.0, 0.0, 1.0), prior.root11, prior.root21)
    root = add_factor(root, 0.0, prior.root22)
    k = next_scan[min(max(int((low - curve.start) / curve.step), 0), next_scan.size - 1)]
    values[0, 0] = low
    points = 1
    while k < scan.size and scan[k] < high:
        if scan[k] > low:
            values[points, 0] = scan[k]
            points += 1
        k += 1
    values[points, 0] = high
    points += 1
    # with one knot within reach the curve is near straight over all of it
    single = points <= 3 and not prior.born
    if not single:
        for j in range(points):
            values[j, 1] = log_density(values[j, 0], first, second, prior, spread, curve)
    valley = 0
    for j in range(1 if single else points):
        start, below, above = min(max(prior.centre, low), high), low, high
        left, right = low, high
        if not single:
            before = values[j - 1, 1] if j > 0 else -math.inf
            after = values[j + 1, 1] if j + 1 < points else -math.inf
            if not before <= values[j, 1] > after:
                continue
            last = j
            while last + 1 < points and values[last + 1, 1] <= values[last, 1]:
                last += 1
            left, right = values[valley, 0], values[last, 0]
            valley = last
            start = values[j, 0]
            below, above = values[max(j - 1, 0), 0], values[min(j + 1, points - 1), 0]
        if plain:
            u, scale = climb_plain(start, below, above, first, second, prior, root, curve)
        else:
            scale = min(width, above - below)
            u, scale = climb(start, below, above, scale, first, second, prior, spread, curve)
        count = integrate(
            choices,
            count,
            parent,
            u,
            scale,
            left,
            right,
            first,
            second,
            prior,
            spread,
            curve,
            linear,
        )
    return count
