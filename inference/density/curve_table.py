"""The curve of mean readings, tabulated once for all frames of a parameter vector."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import Pair
from inference.density.integrand import (
    Law,
    Quad,
    ReferenceLaw,
    Triple,
    log_range_density,
    log_resolution,
)
from inference.density.warp import Curve, curve_at
from simulator.compiled import compiled
from simulator.readings import background_readings, object_readings

__all__ = ["integration_bounds", "tabulate"]

Array = NDArray[np.float64]

_KNOT_SPACING = 0.0365  # 192 knots over the default prior's seven e-folds
_FEWEST_KNOTS = 192
_MOST_KNOTS = 16384
_TURN = 0.7  # cosine of the largest turn of the curve at a knot
_VISIBLE = 0.3  # standard deviations of a reading below which a turn of the curve is not seen
_REACH = 9.0  # standard deviations of a normal prior beyond which it leaves nothing
_FARTHEST = 38.5  # at which its density is no number any more: so far readings may contradict it
_FACTOR = 3.0  # log range up to which that is looked at


@compiled
def integration_bounds(law: Law | ReferenceLaw) -> Pair:
    """Return the interval of u = log r that holds all the mass but rounding.

    Also that of a posterior whose readings contradict a narrow prior: cut where the prior alone
    leaves nothing, it would pile up at the cut.
    """
    low, high = law[6], law[7]
    if law[3] > 0.0:
        # from the point of the support where the density is largest: it may be an end
        centre = min(max(law[2], low), high)
        low, high = max(low, centre - _FARTHEST / law[3]), min(high, centre + _FARTHEST / law[3])
    if not high > low or not high > 0.0:
        return 0.0, -1.0
    # only a law that is not one of log r has next to nothing near zero
    floor = 1e-6 * high if law[1] > -1.0 else 1e-300
    first, last = math.log(max(low, floor)), math.log(high)
    if law[5] > 0.0:
        centre = min(max(law[4], first), last)
        reach = max(_REACH / law[5], min(_FARTHEST / law[5], _FACTOR))
        first, last = max(first, centre - reach), min(last, centre + reach)
    return first, last


@compiled
def _fill(
    table: Array,
    k: int,
    u: float,
    shape: Triple,
    background: Quad | None,
    law: Law | ReferenceLaw,
    r0: float,
    wave: Pair | None,
    delta: Curve | None,
    crosstalk: Pair | None,
    read: Pair,
    shot: float | None,
    strongest: float,
) -> None:
    """Fill one column of a table."""
    r = math.exp(u)
    strength = shape[0]
    if delta is not None:
        strength *= math.exp(curve_at(u, delta)[0])
    o1, o2 = object_readings(r, r0, wave, strength, shape[1], shape[2])
    table[0, k], table[1, k] = u, log_range_density(r, u, law)
    if len(law) == 9:  # decided at compile time
        table[1, k] += log_resolution(
            u, strongest, shape, crosstalk, background, r0, wave, read, shot, None, delta
        )
    table[2, k], table[3, k] = o1, o2
    table[4, k], table[5, k] = o1, o2
    if background is not None:
        b1, b2 = background_readings(r, r0, wave, background)
        table[4, k], table[5, k] = o1 + b1, o2 + b2


@compiled
def _changes_sign(before: float, after: float, unit: float) -> bool:
    """Tell whether a quantity changes sign over a visible step."""
    return (before < 0.0) != (after < 0.0) and abs(after - before) > unit


@compiled
def _too_coarse(
    split: NDArray[np.bool_],
    table: Array,
    offset: Pair,
    unit: Pair,
    pulsed: bool,
    shot: float | None,
) -> int:
    """Mark the segments of a table that want a knot in their middle; count them."""
    split[:] = False
    x1 = (table[4, 1] - table[4, 0]) / unit[0]
    y1 = (table[5, 1] - table[5, 0]) / unit[1]
    length1 = x1 * x1 + y1 * y1
    for k in range(1, table.shape[1] - 1):
        x2 = (table[4, k + 1] - table[4, k]) / unit[0]
        y2 = (table[5, k + 1] - table[5, k]) / unit[1]
        length2 = x2 * x2 + y2 * y2
        along = x1 * x2 + y1 * y2
        if max(length1, length2) > _VISIBLE**2 and (
            along <= 0.0 or along * along < _TURN**2 * length1 * length2
        ):
            split[k - 1] = split[k - 1] or length1 > _VISIBLE**2
            split[k] = length2 > _VISIBLE**2
        x1, y1, length1 = x2, y2, length2
    if shot is not None:
        # shot noise vanishes where a mean reading does, and the difference's where both are equal
        for k in range(split.size):
            a1, a2 = table[4, k] + offset[0], table[4, k + 1] + offset[0]
            b1, b2 = table[5, k] + offset[1], table[5, k + 1] + offset[1]
            crosses = _changes_sign(a1, a2, unit[0]) or _changes_sign(b1, b2, unit[1])
            if pulsed:
                crosses = crosses or _changes_sign(a1 - b1, a2 - b2, min(unit[0], unit[1]))
            split[k] = split[k] or crosses
    count = 0
    for k in range(split.size):
        # a segment of a few roundings is as short as it can be
        split[k] = split[k] and table[0, k + 1] - table[0, k] > 1e-12 * (1.0 + abs(table[0, k]))
        count += split[k]
    return count


@compiled
def tabulate(
    bounds: Pair,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    law: Law | ReferenceLaw,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    strongest: float,
    delta: Curve | None = None,
) -> Array:
    """Tabulate the curve of mean readings, knots closer where it turns.

    Between knots the distance of a reading from the curve has one minimum as long as the curve is
    near straight there. Evenly spaced knots miss the turns of a sine wave over many wavelengths,
    the narrow peak of a flux with c1 near -2 sqrt(c0), and the place where shot noise vanishes.

    Parameters
    ----------
    bounds : (float, float)
        From `integration_bounds`.
    shape, crosstalk, background, law, r0, wave, read, shot
        As for `log_integrand`.
    strongest : float
        Largest gain factor of the frames: what a turn of the curve is held against.
    delta : Curve, optional
        As for `log_integrand`.

    Returns
    -------
    ndarray, shape (6, knots)
        u, log prior, object's readings, scene's readings; readings without gain factor and
        crosstalk.
    """
    n = max(_FEWEST_KNOTS, math.ceil((bounds[1] - bounds[0]) / _KNOT_SPACING) + 1)
    unit = (read[0] / strongest, read[1] / strongest)
    offset = (0.0, 0.0)
    if crosstalk is not None:
        offset = (crosstalk[0] / strongest, crosstalk[1] / strongest)
    table = np.empty((6, n))
    noise = (crosstalk, read, shot, strongest)
    for k in range(n):
        u = bounds[0] + (bounds[1] - bounds[0]) * k / (n - 1)
        _fill(table, k, u, shape, background, law, r0, wave, delta, *noise)
    while True:
        split = np.empty(n - 1, dtype=np.bool_)
        more = _too_coarse(split, table, offset, unit, wave is None, shot)
        if more == 0 or n + more > _MOST_KNOTS:
            return table
        finer = np.empty((6, n + more))
        k = 0
        for j in range(n):
            finer[:, k] = table[:, j]
            k += 1
            if j < n - 1 and split[j]:
                middle = 0.5 * (table[0, j] + table[0, j + 1])
                _fill(finer, k, middle, shape, background, law, r0, wave, delta, *noise)
                k += 1
        table, n = finer, n + more
