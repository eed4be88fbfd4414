"""Coordinates in which a fit moves: logarithms of what is positive, the shape of the objects.

Nothing depends on units in them: log c0, log(1 + c1 / (2 sqrt c0)), log c2, log of strength and
distance of the background, the same two for the shadow; crosstalk in units of the noise. Where a
background stands behind it, crosstalk's coordinate is the *static light*: what an empty scene
reads, crosstalk and bare background together. The frames tell that sum far better than its parts,
and what a step leaves of the sum would be a curved valley in crosstalk and background; in the sum
the valley is straight.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS, Bounds, Layout, Place, Static
from inference.frame.arguments import Pair
from inference.frame.sensitivity import Value
from simulator.compiled import compiled

__all__ = ["KNOWN", "SAME", "SHAPES", "bounds_of", "chain", "move_inside", "physical"]

Array = NDArray[np.float64]

KNOWN, SAME = -1, -2
SHAPES = (Value.C1, Value.SHADOW_C1)  # each with its c0 before it
_SHADOW = int(Value.SHADOW_C0 - Value.C0)  # from a number of the object to that of its shadow
_TIGHTEST = -13.0  # log(1 + c1 / (2 sqrt c0)): a part in half a million above the poles


@compiled
def _shape(c0: float, x: float) -> float:
    return 2.0 * math.sqrt(c0) * math.expm1(x)


@compiled
def _bare(distance: float, static: Static) -> Pair:
    """Return the readings of a bare background of strength one."""
    if static.wave_number > 0.0:
        phase = static.wave_number * distance + static.phase
        return math.cos(phase), math.sin(phase)
    return min(distance / static.r0, 1.0), 1.0


@compiled
def _bare_slopes(distance: float, static: Static) -> Pair:
    """Return the derivative of `_bare` along the distance."""
    if static.wave_number > 0.0:
        k, phase = static.wave_number, static.wave_number * distance + static.phase
        return -k * math.sin(phase), k * math.cos(phase)
    return (1.0 / static.r0 if distance < static.r0 else 0.0), 0.0


@compiled
def physical(values: Array, x: Array, layout: Layout) -> bool:
    """Fill the physical values; tell whether they are numbers.

    Parameters
    ----------
    values : ndarray, shape (SLOTS,)
        Filled.
    x : ndarray, shape (d,)
        Coordinates.
    layout : Layout
        Which value is which coordinate.
    """
    for k in range(SLOTS):
        j = layout.coordinate[k]
        if j == KNOWN:
            values[k] = layout.known[k]
        elif j == SAME:
            values[k] = values[k - _SHADOW]
        elif k in CROSSTALK:
            values[k] = x[j]
        elif k in SHAPES:
            values[k] = _shape(values[k - 1], x[j])
        else:
            values[k] = math.exp(x[j])
    share = layout.static.share * values[Value.STRENGTH]
    if share > 0.0:
        bare = _bare(values[Value.DISTANCE], layout.static)
        for side in range(2):
            k = CROSSTALK[side]
            if layout.coordinate[k] >= 0:
                values[k] -= share * bare[side]
    good = values[Value.C0] > 0.0 and values[Value.C2] > 0.0
    for k in range(SLOTS):
        good = good and math.isfinite(values[k])
    return bool(good)


@compiled
def bounds_of(bounds: Bounds, values: Array, layout: Layout) -> None:
    """Fill the least and largest value of each coordinate.

    Parameters
    ----------
    bounds : Bounds
        Filled.
    values : ndarray
        From `physical`: the bounds of a shape c1 move with c0.
    layout : Layout
        Which value is which coordinate.
    """
    low, high = bounds
    least, largest = layout.least, layout.largest
    for k in range(SLOTS):
        j = layout.coordinate[k]
        if j < 0:
            continue
        if k in CROSSTALK:
            low[j], high[j] = least[k], largest[k]
        elif k in SHAPES:
            root = 2.0 * math.sqrt(values[k - 1])
            low[j], high[j] = _TIGHTEST, math.inf
            if least[k] > root * math.expm1(_TIGHTEST):
                low[j] = math.log1p(least[k] / root)
            if largest[k] < math.inf:
                high[j] = max(math.log1p(max(largest[k] / root, -1.0 + 1e-15)), low[j])
        else:
            low[j] = math.log(least[k]) if least[k] > 0.0 else -math.inf
            high[j] = math.log(largest[k])


@compiled
def move_inside(place: Place, bounds: Bounds, layout: Layout) -> bool:
    """Move coordinates into their bounds and fill both; tell whether the values are numbers."""
    x = place.x
    physical(place.values, x, layout)
    bounds_of(bounds, place.values, layout)
    for j in range(x.size):
        x[j] = min(max(x[j], bounds.low[j]), bounds.high[j])
    return physical(place.values, x, layout)


@compiled
def chain(out: Array, values: Array, x: Array, layout: Layout, bounds: Bounds) -> None:
    """Fill the derivative of every physical value along every coordinate.

    Parameters
    ----------
    out : ndarray, shape (SLOTS, d)
        Filled.
    values, x, layout, bounds
        From and for `physical` and `bounds_of`.
    """
    out[:] = 0.0
    for k in range(SLOTS):
        j = layout.coordinate[k]
        if j == SAME:
            for i in range(out.shape[1]):
                out[k, i] = out[k - _SHADOW, i]
        elif j >= 0:
            if k in CROSSTALK:
                out[k, j] = 1.0
            elif k in SHAPES:
                out[k, j] = values[k] + 2.0 * math.sqrt(values[k - 1])
                # a c1 that its own bound holds does not move with c0
                fixed = x[j] <= bounds.low[j] or x[j] >= bounds.high[j]
                if not fixed:
                    for i in range(out.shape[1]):
                        out[k, i] += 0.5 * values[k] / values[k - 1] * out[k - 1, i]
            else:
                out[k, j] = values[k]
    static, strength, distance = layout.static, values[Value.STRENGTH], values[Value.DISTANCE]
    if static.share > 0.0:
        bare, slopes = _bare(distance, static), _bare_slopes(distance, static)
        for side in range(2):
            k = CROSSTALK[side]
            if layout.coordinate[k] >= 0:
                for i in range(out.shape[1]):
                    change = bare[side] * out[Value.STRENGTH, i]
                    change += strength * slopes[side] * out[Value.DISTANCE, i]
                    out[k, i] -= static.share * change
