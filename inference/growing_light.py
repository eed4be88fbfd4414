"""Light that grows with range over a request, as of readings in another order or of another sign.

Of i and q that are swapped, or of the early window of a pulse in place of the late one, near
objects look far. Nothing in a single frame shows it. Over many frames the far ones are then the
brightest, each brighter than those before it: no object that stands in the beam is so, and objects
that differ are so by chance alone (docs/model.md, growing-light).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.crosstalk_in_numbers import crosstalk_in_numbers
from inference.realtime.net import rule_out
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["growing_light"]

Array = NDArray[np.float64]

# of a request of objects whose light does not grow with range: how often it is told
_FALSE_ALARM = 1e-6
_FEWEST = 10  # of fewer places no order is as rare
_LOOKED_AT = 1000  # frames, evenly spaced
_BRIGHT = 10.0  # noises of light, above which frames count
_PLACES = 30  # at most that many parts of all ranges, so that an object at rest is one of them
_APART = 6.0  # standard deviations, to which an object at rest spreads by noise and open crosstalk
_FARTHER = 0.1  # least difference of the medians of both halves [rad, or of r0]
_BRIGHTER = 2.0  # least ratio of theirs
_BELOW_ZERO = 0.2  # a phase or share that far below zero is still contact [rad, or of r0]


def growing_light(scene: Scene, sensor: Sensor, frames: Frames) -> str | None:
    """Return that light grows with range over many frames.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request.

    Returns
    -------
    str or None
        For a person. None where light is in no such order (false alarm at most 1e-6 a request
        of objects that are as bright as they are independently of their range, or of one whose
        light falls with it), where fewer than ten places are seen, and before a wall.
    """
    if len(frames) < _FEWEST or scene.background is not None or sensor.temperature is not None:
        return None
    offset = sensor.timing_offset_s if isinstance(sensor, PulsedSensor) else sensor.phase_offset_rad
    crosstalk = crosstalk_in_numbers(scene, sensor)
    if crosstalk is None or not isinstance(offset, float | int | None):
        return None
    every = frames.select(np.arange(0, len(frames), math.ceil(len(frames) / _LOOKED_AT)))
    every = every.select(np.flatnonzero(rule_out(sensor, every) == 0))
    light = every.readings - np.array(crosstalk.values)
    with np.errstate(all="ignore"):
        size, place = _seen(sensor, light)
        noise = np.square(sensor.noise.read) + sensor.noise.shot * np.abs(every.readings)
        turned = np.sqrt(noise.max(axis=1) + max(crosstalk.sd) ** 2) / size
        bright = (_BRIGHT * turned < 1.0) & np.isfinite(size) & (size > 0.0) & (place > 0.0)
    if bright.sum() < _FEWEST:
        return None
    size = _by_place(size[bright] / every.gains[bright], place[bright], turned[bright])
    n = size.size
    against = int(np.tril(size[:, None] <= size[None, :], -1).sum())
    if n < _FEWEST or _chance(n, against) > _FALSE_ALARM:
        return None
    return _said(sensor, n)


def _seen(sensor: Sensor, light: Array) -> tuple[Array, Array]:
    """Return how much light frames hold, and their range as a phase [rad] or share of r0."""
    if isinstance(sensor, PulsedSensor):
        return light[:, 1], light[:, 0] / light[:, 1] - sensor.known_shift_m / sensor.r0
    phase = np.arctan2(light[:, 1], light[:, 0]) - sensor.known_phase_rad
    return np.hypot(*light.T), np.mod(phase + _BELOW_ZERO, 2.0 * math.pi) - _BELOW_ZERO


def _by_place(size: Array, place: Array, turned: Array) -> Array:
    """Return the light at each place, the nearest first; none where it does not differ much."""
    order = np.argsort(place, kind="stable")
    size, place, turned = size[order], place[order], turned[order]
    half = place.size // 2
    near, far = (np.median(place[part]) for part in (slice(half), slice(half, None)))
    dark, bright = (np.median(size[part]) for part in (slice(half), slice(half, None)))
    reach = float(place[-1] - place[0])
    if far < near + _FARTHER or bright < _BRIGHTER * dark or not reach > 0.0:
        return np.empty(0)
    ends = place + np.maximum(reach / _PLACES, _APART * turned)
    begins, end = list[int](), -math.inf
    for i, (here, own) in enumerate(zip(place.tolist(), ends.tolist(), strict=True)):
        if here > end:
            begins.append(i)
            end = own
    return np.array([np.median(part) for part in np.split(size, begins[1:])])


def _chance(n: int, against: int) -> float:
    """Return how often n numbers in random order have no more pairs against the order.

    Pairs of the i-th with those before it are 0 to i - 1, equally often, whatever the others are
    (Mann 1945).
    """
    law = np.ones(1)
    for i in range(1, n):
        law = np.convolve(law, np.full(i + 1, 1.0 / (i + 1)))
    return float(law[: against + 1].sum())


def _said(sensor: Sensor, n: int) -> str:
    order = (
        "the order of the windows (w1 is the late part of the pulse, w2 all of it)"
        if isinstance(sensor, PulsedSensor)
        else "the order and the signs of i and q"
    )
    return (
        f"light grows with range, at {n} ranges of this request: no object that stands in the beam "
        "is brighter the farther it is. All ranges may be far off, each with a small error: check "
        f"{order}, `crosstalk`, and whether objects stand beyond {sensor.max_range_m:.3g} m, where "
        "ranges begin anew. It is right only where the farther objects are the brighter ones, or "
        "one comes into the beam, or turns to it, as it goes away"
    )
