"""Ranges as sure as their frame by itself tells them, whatever the light, beside learnt crosstalk.

Two readings tell a range by their ratio or phase, whatever the light, as far as the crosstalk is
known. The filter counts the products of uncertain light and motion as noise of a frame while
crosstalk is open (`inference.tracking.second_order`): they must not pass for knowledge of it. That
noise grows with what the prediction is open by, and of light that is open by more than a half it
leaves a range hardly better known than that, however bright the object. So where a frame by itself
tells the range better it is reported as by that frame: the crosstalk is that of the hypothesis, the
light any that is possible. The hypotheses stay what they are, and no crosstalk is learnt of it.

docs/model.md, by-frame, has the rule.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.held_crosstalk import hold_told
from inference.tracking.hypotheses import (
    COUNT,
    TOLD1,
    TOLD2,
    Hypotheses,
    U,
    copy,
)
from inference.tracking.light import noise_at_light
from inference.tracking.readings_table import (
    FIRST,
    SECOND,
    Array,
    ReadingsTable,
    cell_of,
    mean_at,
    nuisance_at,
    object_at,
)
from inference.tracking.roots import UNIT, Root, add_factors, solve
from inference.tracking.without_object import carry_told, told_root
from simulator.compiled import compiled

__all__ = ["as_said"]

_STEPS = 8  # of Gauss and Newton; a few are enough
# of the light's square against the crosstalk's variance: of crosstalk known to a fifth of the
# light a range is as straight in its error as least squares take it
_BRIGHT = 25.0
# standard deviations at which the crosstalk is taken: it is the same in all frames, as light is
# (`inference.tracking.second_order`)
_TAKEN_AT = 2.0
_CLOSE = 0.1  # standard deviations that a last step may be long


@compiled
def _take_range(
    of: Hypotheses, row: int, frame: TrackedFrame, table: ReadingsTable, factors: Array
) -> None:
    """Give a hypothesis the range that a frame tells by itself, where it tells it better.

    Least squares beside noise, crosstalk and light, by the steps of Gauss and Newton.
    """
    x, X, gain = of.x, of.X, frame.gain
    n, m = X.shape[1], X.shape[2]
    before = 0.0
    for j in range(m):
        before += X[row, U, j] * X[row, U, j]
    unknown, crosstalk1, crosstalk2 = told_root(of), of.numbers[TOLD1], of.numbers[TOLD2]
    unknown = Root(_TAKEN_AT * unknown.r11, _TAKEN_AT * unknown.r21, _TAKEN_AT * unknown.r22)
    square = unknown.r11 * unknown.r11 + unknown.r21 * unknown.r21 + unknown.r22 * unknown.r22
    light1 = frame.first - table.crosstalk1 - crosstalk1
    light2 = frame.second - table.crosstalk2 - crosstalk2
    if not light1 * light1 + light2 * light2 > _BRIGHT * square:
        return
    u = x[row, U]
    for _ in range(_STEPS):
        value1, value2, slope1, slope2 = mean_at(u, table)
        m1 = gain * value1 + table.crosstalk1 + crosstalk1
        m2 = gain * value2 + table.crosstalk2 + crosstalk2
        e1, e2 = frame.first - m1, frame.second - m2
        noise = UNIT
        if not table.noise.plain:
            o1, o2 = object_at(u, table)
            noise = noise_at_light((m1, m2), (gain * o1, gain * o2), (e1, e2), unknown, table.noise)
        i, part = cell_of(u, table)
        for j in range(n):
            factors[FIRST, j], factors[SECOND, j] = 0.0, 0.0
        factors[FIRST, 0], factors[SECOND, 0] = unknown.r11, unknown.r21
        factors[SECOND, 1] = unknown.r22
        for j in range(n, m):
            g1, g2 = nuisance_at(i, part, j - n, table)
            factors[FIRST, j], factors[SECOND, j] = gain * g1, gain * g2
        root = add_factors(noise, factors, 0)
        # the slope is that of the light which the readings say
        pull1, pull2 = solve(root, e1, e2)
        along1, along2 = gain * slope1, gain * slope2
        for j in range(n, m):
            light = factors[FIRST, j] * pull1 + factors[SECOND, j] * pull2
            here1, here2 = nuisance_at(i, 0.0, j - n, table)
            next1, next2 = nuisance_at(i, 1.0, j - n, table)
            along1 += gain * light * (next1 - here1) / table.step
            along2 += gain * light * (next2 - here2) / table.step
        gain1, gain2 = solve(root, along1, along2)
        told = gain1 * along1 + gain2 * along2
        if not told * before > 1.0:
            return
        gain1, gain2 = gain1 / told, gain2 / told
        step = gain1 * e1 + gain2 * e2
        if step * step * told < _CLOSE * _CLOSE:
            own = gain1 * noise.r11 + gain2 * noise.r21
            square = own * own + gain2 * noise.r22 * (gain2 * noise.r22)
            for j in range(m):
                X[row, U, j] = -(gain1 * factors[FIRST, j] + gain2 * factors[SECOND, j])
            X[row, U, U] = math.sqrt(X[row, U, U] * X[row, U, U] + square)
            x[row, U] = u + step
            return
        u = min(max(u + step, table.start), table.end)


@borrowed
@compiled
def as_said(
    into: Hypotheses,
    of: Hypotheses,
    frame: TrackedFrame,
    readable: bool,
    table: ReadingsTable,
    factors: Array,
) -> None:
    """Copy hypotheses, with ranges as a frame by itself tells them where it tells them better.

    Parameters
    ----------
    into : Hypotheses
        Overwritten: means, roots, weights and count.
    of : Hypotheses
        Of a tracker that learns crosstalk, after the frame.
    frame : TrackedFrame
        The frame.
    readable : bool
        Whether it tells a range by its readings: they are no outlier, nor cut off, and the range is
        not known beside them.
    table : ReadingsTable
        The scene.
    factors : ndarray, shape (2, n + p)
        Overwritten.
    """
    count = int(of.numbers[COUNT])
    carry_told(into, of)
    into.numbers[COUNT] = of.numbers[COUNT]
    for row in range(count + 1):
        copy(into, row, of, row)
        into.weight[row] = of.weight[row]
        opened = hold_told(into, row)
        if readable and opened and row > 0:
            _take_range(into, row, frame, table, factors)
