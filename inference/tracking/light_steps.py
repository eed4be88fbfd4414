"""Steps of an object that its light shows, beside errors of the light that all frames share.

The filter takes what such errors do to the light as new in every frame. Where they are wide, light
that falls to a third from one frame to the next is no surprise to it, and the range is what the
motion before the frame has it, though the frame by itself says that the object has moved. But the
errors are smooth along the range: with an object that moves as it is stated, the light goes on as
it was. Where it does not, the object has moved as none of its motion does, or another surface has
come; either is as likely as an outlier.

docs/model.md, light-steps, has the rule.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    TIME,
    Array,
    Hypotheses,
    U,
    V,
    learns_crosstalk,
)
from inference.tracking.motion import Motion, Rules
from inference.tracking.readings_table import (
    ReadingsTable,
    cell_of,
    mean_at,
    noise_root,
    nuisance_at,
    nuisance_count,
    object_at,
)
from inference.tracking.roots import UNIT, Root
from inference.tracking.square_root import move
from inference.tracking.unsteady import SEEN1, SEEN2, SEEN_GAIN, SEEN_TIME, UNSTEADY
from simulator.compiled import compiled

__all__ = ["may_step"]

_ALLOWED = 5.0  # standard deviations by which light may change: noise exceeds it once in 2 million
_SHARED = 3.0  # standard deviations by which the slope of the errors that frames share may be off
_KNOWN = 0.1  # of the light: crosstalk that is learnt and less known than this tells no light


@compiled
def _noise_along(
    first: float,
    second: float,
    gain: float,
    u: float,
    along: tuple[float, float],
    table: ReadingsTable,
) -> float:
    """Return the variance of readings along a direction by their noise."""
    root = UNIT
    if not table.noise.plain:
        o1, o2 = object_at(u, table)
        root = noise_root(first, second, gain * o1, gain * o2, table.noise)
    one, other = along[0] * root.r11 + along[1] * root.r21, along[1] * root.r22
    return one * one + other * other


@compiled
def _slope_off(u: float, table: ReadingsTable) -> float:
    """Return the variance of the slope of log light along log r by errors that frames share."""
    i, _ = cell_of(u, table)
    low = table.start + i * table.step
    low1, low2, _, _ = mean_at(low, table)
    high1, high2, _, _ = mean_at(low + table.step, table)
    below, above = low1 * low1 + low2 * low2, high1 * high1 + high2 * high2
    variance = 0.0
    if not min(below, above) > 0.0:
        return math.inf
    for j in range(nuisance_count(table)):
        here1, here2 = nuisance_at(i, 0.0, j, table)
        next1, next2 = nuisance_at(i, 1.0, j, table)
        slope = (next1 * high1 + next2 * high2) / above - (here1 * low1 + here2 * low2) / below
        variance += slope * slope
    return variance / (table.step * table.step)


@borrowed
@compiled
def may_step(
    of: Hypotheses,
    row: int,
    frame: TrackedFrame,
    empty: float,
    table: ReadingsTable,
    rules: Rules,
    work: Array,
) -> bool:
    """Make a hypothesis as unsure of the range as the light has stepped, where it has.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis as it was predicted; changed in place where the light has stepped.
    frame : TrackedFrame
        The frame.
    empty : float
        Its squared surprise to an empty scene.
    table, rules : ReadingsTable, Rules
        Scene, sensor and rules.
    work : ndarray
        As in `Scratch`.

    Returns
    -------
    bool
        Whether it has: such a step is as likely as an outlier.
    """
    numbers, x, X = of.numbers, of.x, of.X
    if numbers.size <= UNSTEADY or math.isnan(numbers[SEEN1]):
        return False
    # what an empty scene explains has left, or tells no range
    if frame.known_rate > 0.0 or rules.rate_sd == 0.0 or not empty > _ALLOWED * _ALLOWED:
        return False
    u, gain, before = x[row, U], frame.gain, frame.gain / numbers[SEEN_GAIN]
    known1, known2, unknown = table.crosstalk1, table.crosstalk2, 0.0
    if learns_crosstalk(of):
        known1, known2 = known1 + x[row, CROSSTALK1], known2 + x[row, CROSSTALK2]
        for j in range(X.shape[-1]):
            one, other = X[row, CROSSTALK1, j], X[row, CROSSTALK2, j]
            unknown += one * one + other * other
    # the light of the frame before, and of this one along it
    was1, was2 = before * (numbers[SEEN1] - known1), before * (numbers[SEEN2] - known2)
    light = math.hypot(was1, was2)
    value1, value2, slope1, slope2 = mean_at(u, table)
    square = value1 * value1 + value2 * value2
    if not (light * _KNOWN > math.sqrt(unknown) and square > 0.0):
        return False
    along = was1 / light, was2 / light
    now = along[0] * (frame.first - known1) + along[1] * (frame.second - known2)
    # slope of log light along log r, and how far the object has moved by its rate
    steep, off = (value1 * slope1 + value2 * slope2) / square, _slope_off(u, table)
    seconds = numbers[TIME] - numbers[SEEN_TIME]
    moved, variance = seconds * x[row, V], 0.0
    for j in range(X.shape[-1]):
        variance += seconds * seconds * X[row, V, j] * X[row, V, j]
    relative = steep * steep * variance
    relative += _SHARED * _SHARED * off * (variance + moved * moved)
    noise = _noise_along(frame.first, frame.second, gain, u, along, table)
    other = _noise_along(numbers[SEEN1], numbers[SEEN2], numbers[SEEN_GAIN], u, along, table)
    drift1, drift2 = along[0] * rules.drift1, along[1] * rules.drift2
    drift = seconds * (drift1 * drift1 + drift2 * drift2)
    # of the brighter of the two, whose light changes more with the range
    brighter = max(light, now)
    allowed = noise + before * before * other + drift + brighter * brighter * relative
    change = now - light * (1.0 + steep * moved)
    if not change * change > _ALLOWED * _ALLOWED * allowed:
        return False
    step, most = abs(math.log(max(now, math.sqrt(noise)) / light)), table.end - table.start
    step = step / abs(steep) if step < most * abs(steep) else most
    move(of, row, Motion(0.0, 1.0, Root(step, 0.0, rules.rate_sd), 0.0, 0.0), work)
    return True
