"""Time derivatives of the readings: measured by the sensor, or differences over a window."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import (
    UNREPRESENTABLE,
    Net,
    net_readings,
    on_time,
    rule_out,
)
from inference.realtime.smoothness import Uneven, rough
from inference.realtime.windows import Windows, differences
from simulator.errors import InvalidInputError
from simulator.frames import Frames, check_increasing
from simulator.sensor import Sensor

__all__ = ["DERIVATIVE_REASONS", "DROWNED_CHANGE", "LONELY", "UNEVEN_GAIN", "derivatives_of"]

Array = NDArray[np.float64]

LONELY, UNEVEN_GAIN, DROWNED_CHANGE, ROUGH, PAIR = range(5)
DERIVATIVE_REASONS = (
    "no other frame to form a difference with",
    "the frame's gain changes, so that unknown crosstalk does not cancel in differences",
    "the readings change by no more than their noise",
    "the readings change too unevenly from frame to frame for a derivative",
    "two frames alone do not tell how far a difference is from the derivative",
)
_TOLD = 1.0 / 3.0  # uncertainty of a direction [rad] above which no bias of a wider window is seen


def derivatives_of(
    sensor: Sensor,
    crosstalk: tuple[float, float] | None,
    frames: Frames,
    first_reason: int,
    uneven_too: bool = False,
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
    uneven_too : bool
        Whether frames count at which readings change unevenly: a chord of a straight line has its
        direction, and a search may begin anywhere.

    Returns
    -------
    Net
        Derivatives [reading units / s] at the sensor's own gain, the bias of differences among
        their variances; these are nan for derivative
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
    check_increasing(frames.time_s)
    # the relative error is independent from frame to frame, so it does not cancel in a difference
    net = net_readings(sensor, crosstalk or (0.0, 0.0), frames, with_relative=True)
    usable = np.flatnonzero(net.state == 0)
    unsure = sensor.noise.relative > 0 and not sensor.noise.flickers
    if crosstalk is None and unsure and usable.size >= 3:
        net = _with_larger_signals(sensor, frames, net, usable)
    gain = frames.gain if crosstalk is None else None
    n = len(frames)
    windows = Windows(*(np.full(n, np.nan) for _ in range(6)))
    state = net.state.copy()
    if usable.size >= 2:
        none = np.zeros(usable.size, dtype=np.bool_)
        uneven = Uneven(none, none)
        if not uneven_too:
            uneven = rough(*_of_frames(usable, frames.time_s, net, gain))
        # No window reaches across what is uneven: it would take in what lies behind a jump. The
        # frames beside it, which tell no range themselves, serve those that are farther away: a
        # window to one side is worst where motion is least even
        for stretch in np.split(usable, np.flatnonzero(np.diff(uneven.at, prepend=uneven.at[0]))):
            part = Windows(*(np.full(stretch.size, np.nan) for _ in range(6)))
            differences(*_of_frames(stretch, frames.time_s, net, gain), not uneven_too, part)
            for whole, some in zip(windows, part, strict=True):
                whole[stretch] = some
        state[usable[uneven.near]] = first_reason + ROUGH
        missing = np.isnan(windows.first) & np.isnan(windows.var1) & (state == 0)
        alone = gain is None or usable.size < 3
        state[missing] = first_reason + (PAIR if alone else UNEVEN_GAIN)
        state[(windows.direction_sd > _TOLD) & (state == 0)] = first_reason + DROWNED_CHANGE
    else:
        state[usable] = first_reason + LONELY
    bad = (state == 0) & ~(np.isfinite(windows.first) & np.isfinite(windows.second))
    state[bad] = UNREPRESENTABLE
    return Net(windows.first, windows.second, windows.var1, windows.var2, windows.cov, 0.0, state)


def _with_larger_signals(sensor: Sensor, frames: Frames, net: Net, usable: NDArray[np.intp]) -> Net:
    """Return readings whose relative error is no less than that of what has changed.

    Unknown crosstalk may cancel the light, of which the relative error is a share. The light is
    more than that of the darkest frame by what a reading differs from it, whatever the crosstalk:
    where that is more than the reading, crosstalk does. How dark the darkest one is nothing tells;
    so the light is then taken for as large as what a reading differs by from any.
    """
    readings = np.column_stack([net.first, net.second])[usable]
    one = int(np.argmax(_lengths(readings - readings[0])))
    other = int(np.argmax(_lengths(readings - readings[one])))
    # of the two that differ most the darker one is where readings change less
    steps = _lengths(np.diff(readings, axis=0))
    change = np.maximum(np.append(steps, 0.0), np.insert(steps, 0, 0.0))
    dark, bright = (other, one) if change[other] < change[one] else (one, other)
    from_dark, from_bright = (
        net_readings(sensor, (first, second), frames, with_relative=True)
        for first, second in frames.readings[usable[[dark, bright]]].tolist()
    )
    size, more, most = (np.hypot(each.first, each.second) for each in (net, from_dark, from_bright))
    parts = []
    for name in ("var1", "var2", "cov"):
        own, its, far = (getattr(each, name) for each in (net, from_dark, from_bright))
        parts.append(np.where(more > size, np.where(most > more, far, its), own))
    return net._replace(var1=parts[0], var2=parts[1], cov=parts[2])


def _lengths(vectors: Array) -> Array:
    return np.asarray(np.hypot(vectors[:, 0], vectors[:, 1]))


def _of_frames(
    chosen: NDArray[np.intp], time_s: Array, net: Net, gain: Array | None
) -> tuple[Array, Net, Array | None]:
    return time_s[chosen], net.select(chosen), None if gain is None else gain[chosen]


def _measured(sensor: Sensor, frames: Frames) -> Net:
    """Use the sensor's own derivatives."""
    assert frames.derivatives is not None  # noqa: S101  # decided by the caller
    sd1, sd2 = sensor.noise.derivative or (math.nan, math.nan)
    n = len(frames)
    with np.errstate(all="ignore"):
        gain = frames.gains
        first, second = frames.derivatives.T / gain
        var1, var2 = (sd1 / gain) ** 2, (sd2 / gain) ** 2
    state = rule_out(sensor, frames)
    bad = ~(np.isfinite(first) & np.isfinite(second))
    state[bad & (state == 0)] = UNREPRESENTABLE
    return on_time(sensor, Net(first, second, var1, var2, np.zeros(n), 0.0, state))
