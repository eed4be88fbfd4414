"""Frames whose light cannot be: below zero, or more of it late than there is in the whole pulse.

Whatever stands before the sensor, at whatever gain and delay, 0 <= w1 <= w2 once the crosstalk is
off. Windows in another order, and crosstalk in another order, sign or unit, break that in some of
the frames, and leave others in which it is as wrong and nothing shows (docs/model.md,
impossible-light).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.crosstalk_in_numbers import CrosstalkInNumbers, crosstalk_in_numbers
from inference.realtime.net import rule_out
from simulator.compiled import compiled
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["impossible_light"]

Array = NDArray[np.float64]

# of a request whose numbers are as stated: how often it is doubted at most
_FALSE_ALARM = 1e-6
_LEAST = 6.0  # standard deviations, and more where so many frames ask for it
_ROUNDINGS = 8 * float(np.finfo(float).eps)
_KINDS = ("w1 below zero", "w2 below zero", "w1 above w2")


def impossible_light(scene: Scene, sensor: Sensor, frames: Frames) -> str | None:
    """Return in which frames of a pulse light is negative, or later than all of it.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request.

    Returns
    -------
    str or None
        For a person. None where noise, what is left open of the crosstalk and the error of the
        effective distance explain all frames (false alarm at most 1e-6 a request), where crosstalk
        is optional or unknown, and of sine waves, whose readings have either sign. Frames without
        the object, and such at full scale, do not count.
    """
    if not isinstance(sensor, PulsedSensor):
        return None
    crosstalk = crosstalk_in_numbers(scene, sensor)
    if crosstalk is None:
        return None
    read = sensor.noise.read
    flat = np.ascontiguousarray(frames.readings).reshape(-1)
    if not _any_beyond(flat, crosstalk.values, (_LEAST * read[0], _LEAST * read[1])):
        return None
    counted = np.flatnonzero(rule_out(sensor, frames) == 0)
    if not counted.size:
        return None
    return _said(counted, _beyond(scene, sensor, frames.readings[counted], crosstalk))


@compiled
def _any_beyond(flat: Array, crosstalk: tuple[float, float], least: tuple[float, float]) -> bool:
    """Tell whether the read noise alone leaves any frame impossible; flat is w1, w2 of each."""
    found = 0
    for i in range(flat.size // 2):
        late, whole = flat[2 * i] - crosstalk[0], flat[2 * i + 1] - crosstalk[1]
        good = (late >= -least[0]) & (whole >= -least[1]) & (late - whole <= least[1])
        found += 0 if good else 1
    return found > 0


def _beyond(
    scene: Scene, sensor: PulsedSensor, readings: Array, crosstalk: CrosstalkInNumbers
) -> Array:
    """Return by how many standard deviations frames are impossible, shape (3, n): `_KINDS`."""
    values = np.array(crosstalk.values)
    with np.errstate(all="ignore"):
        late, whole = (readings - values).T
        # of light that is none the photons are those of the crosstalk: noise has lowered a reading
        # and, taken from it, its own size
        photons = sensor.noise.shot * np.maximum(np.abs(readings), np.abs(values))
        rounding = _ROUNDINGS * (np.abs(readings) + np.abs(values))
        own = np.square(sensor.noise.read) + np.square(crosstalk.sd) + photons
        own = (own + np.square(rounding)).T
        moved = np.square(scene.allowed_error.range_m / sensor.r0 * whole)
        return np.stack(
            [
                -late / np.sqrt(own[0] + moved),
                -whole / np.sqrt(own[1]),
                # photons that are late are part of all, and cancel: this is their most
                (late - whole) / np.sqrt(own[0] + own[1] + moved),
            ]
        )


def _said(counted: NDArray[np.intp], beyond: Array) -> str | None:
    # a normal law has less than exp(-x^2 / 2) / 2 beyond x
    limit = max(_LEAST, math.sqrt(2.0 * math.log(beyond.size / (2.0 * _FALSE_ALARM))))
    over = beyond > limit
    any_ = over.any(axis=0)
    if not any_.any():
        return None
    shown = ", ".join(
        f"{kind} in {int(here.sum())} (first frame {int(counted[np.argmax(here)])}, by up to "
        f"{float(sizes[here].max()):.3g} standard deviations)"
        for kind, here, sizes in zip(_KINDS, over, beyond, strict=True)
        if here.any()
    )
    return (
        f"light is impossible in {int(any_.sum())} of {any_.size} frames by far more than noise, "
        f"with the stated crosstalk off: {shown}. The ranges of all other frames rest on the same "
        "statement, and may be as wrong though nothing shows in them: check the order of the "
        "windows (w1 is the late part of the pulse, w2 all of it), the order, sign and unit of "
        "`crosstalk`, and noise.read"
    )
