"""Frames whose echo may have been moved out of the late window, by a delay that is known.

The share of a pulse's light that the late window takes grows along the range as (r + s) / r0, s the
length by which all light comes late, and stays at 0 and 1 beyond. Techniques take s off: an object
beyond the ends then has the range of the end, r0 - s or -s, as sure as any (docs/model.md,
clipped-light).
"""

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import END_BAND
from inference.realtime.net import net_readings
from simulator.at_temperature import warmth
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, shift_of

__all__ = ["beside_ends", "may_come_late"]

_SLACK = 1e-9  # of r0: with a known offset the ranges allowed end where the windows do


def may_come_late(sensor: PulsedSensor) -> bool:
    """Tell whether a sensor states anything that moves its light in time."""
    return sensor.timing_offset_s is not None or sensor.temperature is not None


def beside_ends(
    sensor: PulsedSensor,
    frames: Frames,
    crosstalk: tuple[float, float],
    support: tuple[float, float],
) -> NDArray[np.bool_] | None:
    """Tell in which frames noise may hide that the whole pulse, or nothing of it, is late.

    Parameters
    ----------
    sensor, frames : PulsedSensor, Frames
        As stated and as read, n of them.
    crosstalk : (float, float)
        Known crosstalk [reading units].
    support : (float, float)
        Least and greatest range that the scene allows [m]: an end beyond these is none.

    Returns
    -------
    ndarray of bool, shape (n,), or None
        None where light comes when it should: that a range ends is its technique's.
    """
    shift = _shift_m(sensor, frames)
    if shift is None:
        return None
    as_read = sensor.model_copy(update={"temperature": None, "timing_offset_s": None})
    net = net_readings(as_read, crosstalk, frames)
    one = np.ones(len(frames))
    early = net.second - net.first
    slack = _SLACK * sensor.r0
    whole_is_late = early < END_BAND * np.sqrt(net.variance(-one, one))
    whole_is_late &= support[1] > sensor.r0 - shift - slack
    # light that comes too early leaves the window at its other end, nearer than -s
    none_is_late = net.first < END_BAND * np.sqrt(net.variance(one, 0.0 * one))
    none_is_late &= (shift < 0) & (support[0] < slack - shift)
    return np.asarray((shift != 0) & (whole_is_late | none_is_late))


def _shift_m(sensor: PulsedSensor, frames: Frames) -> NDArray[np.float64] | None:
    """Return by which length light comes late, shape (n,) [m]; None where it never does."""
    always, warm = sensor.known_shift_m, warmth(sensor, frames)
    drift = 0.0 if sensor.temperature is None else sensor.temperature.known[1]
    if warm is None or drift == 0.0:
        # nothing is made for every frame where there is nothing to say
        return None if always == 0.0 else np.full(len(frames), always)
    return np.asarray(always + shift_of(drift) * np.where(np.isfinite(warm), warm, 0.0))
