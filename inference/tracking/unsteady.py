"""Whether readings jump from frame to frame by more than their noise, whatever the model errs by.

An error that all frames share may be far off for as long as an object stays where it is, so that a
surprise tells little of it. But it is smooth along the range, and what is left of the readings
across the curve hardly changes with it from one frame to the next: that changes by noise. Noise
that is stated too small shows at once, beside any error of the model or of the scene.

Frames without an object tell the noise, too: there both readings change by nothing else.

What is left across the curve may also last, by more than those errors: another object, light that
nobody stated. `inference.tracking.lasting` has its mean.

docs/model.md, unsteady, has the statistic.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2, Hypotheses, learns_crosstalk
from inference.tracking.lasting import (
    crosstalk_variance,
    first_lasting,
    sagitta,
    take_lasting,
)
from inference.tracking.motion import Rules
from inference.tracking.readings_table import (
    FIRST,
    SECOND,
    ReadingsTable,
    cell_of,
    mean_at,
    noise_root,
    nuisance_at,
    nuisance_count,
    object_at,
)
from inference.tracking.roots import UNIT
from simulator.compiled import compiled

__all__ = [
    "OUTLIERS",
    "SEEN1",
    "SEEN2",
    "SEEN_GAIN",
    "SEEN_TIME",
    "UNSTEADY",
    "first_unsteady",
    "take_empty",
    "take_unsteady",
]

Array = NDArray[np.float64]

# places in `Hypotheses.numbers` behind its own, only where errors that frames share are felt: the
# running mean, how many frames up to the last were outliers one after another, and of the last
# that was none its time, what is left of its two readings, the direction across the curve (of an
# empty scene nan and the gain), its readings and factor on the gain (of an empty scene nan), and
# what every nuisance parameter does along that direction; behind them what lasts
UNSTEADY, OUTLIERS, SEEN_TIME, _LEFT1, _LEFT2, _ACROSS1, _ACROSS2 = range(36, 43)
SEEN1, SEEN2, SEEN_GAIN, _SHARED = range(43, 47)
_GAIN = _ACROSS2
# standard deviations that an error which frames share may be off by: beyond it one in a million is
_ALLOWED = 5.0
_HIDES = 25.0  # variance of an empty scene's readings, in units of the noise, that hides an object
_MOST = 15.1  # squared change at which a single frame is cut: noise exceeds it once in 10,000


def first_unsteady(nuisance: int) -> list[float]:
    """Return these numbers before any frame, of so many nuisance parameters."""
    return [1.0, 0.0] + [math.nan] * (_SHARED - SEEN_TIME + nuisance) + first_lasting(nuisance)


@borrowed
@compiled
def take_unsteady(
    of: Hypotheses,
    row: int,
    u: float,
    sd: float,
    frame: TrackedFrame,
    time: float,
    table: ReadingsTable,
    rules: Rules,
) -> None:
    """Take a frame into the running means of what is left across the curve, and of its changes.

    Parameters
    ----------
    of, row : Hypotheses, int
        The state, and the hypothesis whose crosstalk is taken; the numbers are changed in place.
    u, sd : float
        log r of the frame, and its standard deviation.
    frame, time : TrackedFrame, float
        The frame and when it was [s].
    table, rules : ReadingsTable, Rules
        Scene, sensor and rules.
    """
    numbers, gain = of.numbers, frame.gain
    value1, value2, slope1, slope2 = mean_at(u, table)
    left1, left2 = frame.first - gain * value1, frame.second - gain * value2
    known1, known2 = table.crosstalk1, table.crosstalk2
    if learns_crosstalk(of):
        known1, known2 = known1 + of.x[row, CROSSTALK1], known2 + of.x[row, CROSSTALK2]
    noise = UNIT
    if not table.noise.plain:
        o1, o2 = object_at(u, table)
        m1, m2 = gain * value1 + known1, gain * value2 + known2
        noise = noise_root(m1, m2, gain * o1, gain * o2, table.noise)
    # across the curve, in units of the noise there
    along, beside = noise.r21 * slope1 - noise.r11 * slope2, noise.r22 * slope1
    size = math.sqrt(along * along + beside * beside)
    if not size > 0.0:
        return
    across1, across2 = -slope2 / size, slope1 / size
    i, part = cell_of(u, table)
    turn1, turn2 = across1 - numbers[_ACROSS1], across2 - numbers[_ACROSS2]
    shared, count = 0.0, nuisance_count(table)
    for j in range(count):
        g1, g2 = nuisance_at(i, part, j, table)
        new = gain * (across1 * g1 + across2 * g2)
        change = new - numbers[_SHARED + j]
        shared += change * change
        numbers[_SHARED + j] = new
    seconds = time - numbers[SEEN_TIME]
    drift1, drift2 = rules.drift1 * across1, rules.drift2 * across2
    variance = 2.0 + _ALLOWED * _ALLOWED * shared + seconds * (drift1 * drift1 + drift2 * drift2)
    change = across1 * left1 + across2 * left2
    change -= numbers[_ACROSS1] * numbers[_LEFT1] + numbers[_ACROSS2] * numbers[_LEFT2]
    # the crosstalk that is taken from both is the same
    change -= turn1 * known1 + turn2 * known2
    deviation = across1 * (left1 - known1) + across2 * (left2 - known2)
    bend = gain * sagitta(u, sd, across1, across2, table)
    open_crosstalk = crosstalk_variance(of, row, across1, across2, table)
    take_lasting(numbers, count, deviation, bend, open_crosstalk, rules.memory)
    if not math.isnan(change):
        own = min(change * change / variance, _MOST)
        numbers[UNSTEADY] += (1.0 - rules.memory) * (own - numbers[UNSTEADY])
    numbers[SEEN_TIME], numbers[_LEFT1], numbers[_LEFT2] = time, left1, left2
    numbers[_ACROSS1], numbers[_ACROSS2] = across1, across2
    numbers[SEEN1], numbers[SEEN2], numbers[SEEN_GAIN] = frame.first, frame.second, gain


@borrowed
@compiled
def take_empty(
    of: Hypotheses,
    frame: TrackedFrame,
    time: float,
    table: ReadingsTable,
    empty: Array,
    rules: Rules,
) -> None:
    """Take a frame without an object into the running mean of changes: both readings tell it.

    Not where the readings of the empty scene are open by more than noise: an object that moves may
    pass for one.

    Parameters
    ----------
    of : Hypotheses
        The state; the numbers are changed in place.
    frame, time : TrackedFrame, float
        The frame and when it was [s].
    table : ReadingsTable
        Known crosstalk, and the noise.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene without crosstalk, and their change with the nuisance
        parameters.
    rules : Rules
        How crosstalk drifts, and the memory of the mean.
    """
    numbers, gain = of.numbers, frame.gain
    first = frame.first - gain * empty[FIRST, 0]
    second = frame.second - gain * empty[SECOND, 0]
    # what was before: nothing, an object, or an empty scene
    change1, change2 = first - numbers[_LEFT1], second - numbers[_LEFT2]
    after_empty = math.isnan(numbers[_ACROSS1]) and not math.isnan(change1)
    seconds, brighter = time - numbers[SEEN_TIME], gain - numbers[_GAIN]
    shared, hidden = 0.0, 0.0
    numbers[SEEN_TIME], numbers[_LEFT1], numbers[_LEFT2] = time, first, second
    numbers[_ACROSS1], numbers[_GAIN], numbers[SEEN1] = math.nan, gain, math.nan
    if not after_empty:
        return
    n, m = of.X.shape[1], of.X.shape[-1]
    learns = learns_crosstalk(of)
    for j in range(m):
        f1, f2 = 0.0, 0.0
        if learns:
            f1, f2 = of.X[0, CROSSTALK1, j], of.X[0, CROSSTALK2, j]
        if j >= n:
            g1, g2 = empty[FIRST, 1 + j - n], empty[SECOND, 1 + j - n]
            shared += brighter * brighter * (g1 * g1 + g2 * g2)
            f1, f2 = f1 + gain * g1, f2 + gain * g2
        hidden += f1 * f1 + f2 * f2
    if hidden > _HIDES:
        return
    root = UNIT
    if not table.noise.plain:
        m1, m2 = frame.first - first + table.crosstalk1, frame.second - second + table.crosstalk2
        if learns_crosstalk(of):
            m1, m2 = m1 + of.x[0, CROSSTALK1], m2 + of.x[0, CROSSTALK2]
        root = noise_root(m1, m2, 0.0, 0.0, table.noise)
    change1 /= root.r11
    change2 = (change2 - root.r21 * change1) / root.r22
    variance = 2.0 + _ALLOWED * _ALLOWED * shared
    variance += seconds * (rules.drift1 * rules.drift1 + rules.drift2 * rules.drift2)
    own = min(0.5 * (change1 * change1 + change2 * change2) / variance, 0.5 * _MOST)
    numbers[UNSTEADY] += (1.0 - rules.memory) * (own - numbers[UNSTEADY])
