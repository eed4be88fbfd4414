"""Time derivatives of the readings: measured by the sensor, or differences over a window.

A moving average of M + 1 first differences is the difference (x_i - x_(i-M-1)) / (M + 1) (App. A,
25-27 as corrected): a longer window has less noise, and belongs to its centre. So a frame's own
derivative needs a window around it. Three readings (i - m, i, i + m) with Lagrange's weights give
it to second order at any spacing; with equal spacing it is the difference over 2 m, so M = 2 m - 1.
At the ends, and nowhere else, the window is (i, i + m, i + 2 m), or its mirror.

The half width m is Lepski's choice: the widest window whose direction of the derivative agrees with
that of every narrower one within twice the narrower one's standard deviation. Noise widens it, and
motion that bends the curves narrows it, without a model of either. What remains is a bias of the
ratio of about -(N + 1)/3 (v h / r)^2 for a flux falling as r^-N and a half width of h seconds: as
large as the noise of narrower windows lets it be. So the noise that is stated is that of the widest
window at most half as wide; where even its direction drowns, nothing is told.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import (
    UNREPRESENTABLE,
    Net,
    net_readings,
    rule_out,
)
from simulator.compiled import compiled
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["DERIVATIVE_REASONS", "LONELY", "UNEVEN_GAIN", "derivatives_of"]

Array = NDArray[np.float64]

LONELY, UNEVEN_GAIN, DROWNED_CHANGE = range(3)
DERIVATIVE_REASONS = (
    "no other frame to form a difference with",
    "the frame's gain changes, so that unknown crosstalk does not cancel in differences",
    "the readings change by no more than their noise",
)
_HALF_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_AGREEMENT = 2.0
_END = 4  # frames from an end, where windows to one side are better than none
_TOLD = 1.0 / 3.0  # uncertainty of a direction [rad] above which no bias of a wider window is seen


@compiled
def _weights(ta: float, tb: float, tc: float, at: int) -> tuple[float, float, float]:
    """Lagrange's weights of the derivative at ta (at = 0), tb (1) or tc (2)."""
    x = ta if at == 0 else (tb if at == 1 else tc)
    wa = ((x - tb) + (x - tc)) / ((ta - tb) * (ta - tc))
    wb = ((x - ta) + (x - tc)) / ((tb - ta) * (tb - tc))
    wc = ((x - ta) + (x - tb)) / ((tc - ta) * (tc - tb))
    return wa, wb, wc


class _Windows(NamedTuple):
    """Differences over the window of every frame, each of shape (n,); nan where none is allowed.

    Attributes
    ----------
    first, second : ndarray
        Derivatives of both readings [reading units / s].
    var1, var2, cov : ndarray
        Their noise.
    direction_sd : ndarray
        Uncertainty of their direction [rad].
    """

    first: Array
    second: Array
    var1: Array
    var2: Array
    cov: Array
    direction_sd: Array


class _Tried(NamedTuple):
    """The windows tried for a frame: direction, its uncertainty, noise and half width."""

    angle: Array
    sd: Array
    v1: Array
    v2: Array
    v12: Array
    half_width: Array


@compiled
def _direction(d1: float, d2: float, v1: float, v2: float, v12: float) -> tuple[float, float]:
    """Return the direction of a derivative in units of its noise, modulo pi, and its sd [rad]."""
    s1, s2 = math.sqrt(v1), math.sqrt(v2)
    x, y = d2 / s2, d1 / s1
    size = x * x + y * y
    spread = x * x + y * y - 2.0 * x * y * v12 / (s1 * s2)
    sd = math.sqrt(max(spread, 0.0)) / size if size > 0.0 else math.inf
    return math.atan2(y, x), sd


@compiled
def _agrees(angle: float, tried: _Tried, count: int) -> bool:
    """Whether a direction agrees with those of all narrower windows."""
    for earlier in range(count):
        off = abs(angle - tried.angle[earlier]) % math.pi
        off = min(off, math.pi - off)
        if off > _AGREEMENT * tried.sd[earlier]:
            return False
    return True


@compiled
def _differences(
    t: Array, net: Net, gain: Array | None, half_widths: tuple[int, ...], out: _Windows
) -> None:
    """Fill in the differences of n frames with times t."""
    first, second, var1, var2, cov = net.first, net.second, net.var1, net.var2, net.cov
    n = t.size
    most = len(half_widths)
    tried = _Tried(
        np.empty(most),
        np.empty(most),
        np.empty(most),
        np.empty(most),
        np.empty(most),
        np.empty(most),
    )
    for i in range(n):
        count = 0
        near_end = min(i, n - 1 - i) < _END
        for m in half_widths:
            if i >= m and i + m < n:
                a, b, c, at = i - m, i, i + m, 1
            elif near_end and i + 2 * m < n:
                a, b, c, at = i, i + m, i + 2 * m, 0
            elif near_end and i >= 2 * m:
                a, b, c, at = i - 2 * m, i - m, i, 2
            elif n == 2:
                a, b, c, at = 0, 0, 1, -1
            else:
                break
            if gain is not None and (gain[a] != gain[b] or gain[b] != gain[c]):
                break
            if at < 0:
                wc = 1.0 / (t[c] - t[a])
                wa, wb = -wc, 0.0
            else:
                wa, wb, wc = _weights(t[a], t[b], t[c], at)
            # differences from the frame's own reading, so that a constant cancels exactly
            o1, o2 = first[b], second[b]
            d1 = wa * (first[a] - o1) + wc * (first[c] - o1)
            d2 = wa * (second[a] - o2) + wc * (second[c] - o2)
            v1 = wa * (wa * var1[a]) + wb * (wb * var1[b]) + wc * (wc * var1[c])
            v2 = wa * (wa * var2[a]) + wb * (wb * var2[b]) + wc * (wc * var2[c])
            v12 = wa * (wa * cov[a]) + wb * (wb * cov[b]) + wc * (wc * cov[c])
            angle, sd = _direction(d1, d2, v1, v2, v12)
            if not _agrees(angle, tried, count):
                break
            tried.angle[count], tried.sd[count], tried.half_width[count] = angle, sd, m
            tried.v1[count], tried.v2[count], tried.v12[count] = v1, v2, v12
            count += 1  # noqa: SIM113  # not every width is tried
            out.first[i], out.second[i] = d1, d2
            # a bias is seen only where it exceeds the noise of a narrower window: of one half as
            # wide, whose own bias is a quarter
            narrower = 0
            for earlier in range(count):
                if 2.0 * tried.half_width[earlier] <= m:
                    narrower = earlier
            out.var1[i], out.var2[i] = tried.v1[narrower], tried.v2[narrower]
            out.cov[i], out.direction_sd[i] = tried.v12[narrower], tried.sd[narrower]
            if at < 0:
                break


def derivatives_of(
    sensor: Sensor, crosstalk: tuple[float, float] | None, frames: Frames, first_reason: int
) -> Net:
    """Return the derivatives of the signals of object and background with their noise.

    Parameters
    ----------
    sensor : Sensor
        Its noise; ``noise.derivative`` for derivative columns.
    crosstalk : (float, float), optional
        Known crosstalk; it matters only where the gain of frames differs.
    frames : Frames
        With derivative columns, or with times.
    first_reason : int
        Place of `DERIVATIVE_REASONS` among the reasons of the technique.

    Returns
    -------
    Net
        Derivatives [reading units / s] at the sensor's own gain; variances are nan for derivative
        columns whose noise the sensor does not state.

    Raises
    ------
    InvalidInputError
        At ``/frames/time_s`` where times are missing, repeated or out of order.
    """
    if frames.derivatives is not None:
        return _measured(sensor, frames)
    if frames.time_s is None:
        raise InvalidInputError.at("/frames/time_s", "is missing: differences in time need it")
    backward = np.flatnonzero(~(frames.time_s[1:] > frames.time_s[:-1]))
    if backward.size:
        raise InvalidInputError.at(
            "/frames/time_s", f"must increase: entry {backward[0] + 1} does not"
        )
    # the relative error is independent from frame to frame, so it does not cancel in a difference
    net = net_readings(sensor, crosstalk or (0.0, 0.0), frames, with_relative=True)
    usable = np.flatnonzero(net.state == 0)
    gain = frames.gain if crosstalk is None else None
    n = len(frames)
    windows = _Windows(*(np.full(n, np.nan) for _ in range(6)))
    state = net.state.copy()
    if usable.size >= 2:
        part = _Windows(*(np.full(usable.size, np.nan) for _ in range(6)))
        _differences(
            frames.time_s[usable],
            net.select(usable),
            None if gain is None else gain[usable],
            _HALF_WIDTHS,
            part,
        )
        for whole, some in zip(windows, part, strict=True):
            whole[usable] = some
        missing = np.isnan(windows.first) & np.isnan(windows.var1) & (state == 0)
        state[missing] = first_reason + UNEVEN_GAIN
        state[(windows.direction_sd > _TOLD) & (state == 0)] = first_reason + DROWNED_CHANGE
    else:
        state[usable] = first_reason + LONELY
    bad = (state == 0) & ~(np.isfinite(windows.first) & np.isfinite(windows.second))
    state[bad] = UNREPRESENTABLE
    return Net(windows.first, windows.second, windows.var1, windows.var2, windows.cov, 0.0, state)


def _measured(sensor: Sensor, frames: Frames) -> Net:
    """Use the sensor's own derivatives."""
    assert frames.derivatives is not None  # noqa: S101  # decided by the caller
    sd1, sd2 = sensor.noise.derivative or (math.nan, math.nan)
    n = len(frames)
    with np.errstate(all="ignore"):
        gain = np.ones(n) if frames.gain is None else frames.gain
        first, second = frames.derivatives.T / gain
        var1, var2 = (sd1 / gain) ** 2, (sd2 / gain) ** 2
    state = rule_out(sensor, frames)
    bad = ~(np.isfinite(first) & np.isfinite(second))
    state[bad & (state == 0)] = UNREPRESENTABLE
    return Net(first, second, var1, var2, np.zeros(n), 0.0, state)
