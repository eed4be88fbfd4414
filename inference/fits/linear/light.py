"""Readings that numbers of a scene make at given ranges, over frames."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor

if TYPE_CHECKING:
    from inference.frame.sensitivity import Sensitivity

__all__ = ["background_light", "carrier", "component", "object_light"]

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]


def carrier(sensor: Sensor, r: Array) -> Array:
    """Return what one unit of flux from range r reads, shape (n, 2)."""
    if isinstance(sensor, PulsedSensor):
        return np.stack([np.minimum(r / sensor.r0, 1.0), np.ones_like(r)], axis=1)
    phase = sensor.wave_number * r + sensor.known_phase_rad
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


def component(sensor: Sensor, readings: Array, r: Array) -> Array:
    """Return the size of light from range r in readings: w2, or what is in its phase; (n,)."""
    if isinstance(sensor, PulsedSensor):
        return np.asarray(readings[:, 1])
    return np.asarray(np.einsum("ni,ni->n", readings, carrier(sensor, r)))


def _light(
    sensor: Sensor, shape: Triple, background: Quad | None, r: Array, gain: Array
) -> "Sensitivity":
    from inference.frame.sensitivity import sensitivity

    rows = None if background is None else np.array([background])
    terms = Terms(np.array([shape]), None, rows, np.empty((1, 8)))
    return sensitivity(sensor, terms, np.log(r), gain)


def object_light(sensor: Sensor, shape: Triple, r: Array, frames: Frames) -> tuple[Array, Array]:
    """Return an object's readings and their derivative along log r.

    Parameters
    ----------
    shape : (float, float, float)
        c0 [m^2], c1 [m], c2.
    r : ndarray, shape (n,)
        Ranges [m].
    frames : Frames
        Their gain factors.

    Returns
    -------
    (ndarray, ndarray), each of shape (n, 2)
        nan where the range is.
    """
    seen = _light(sensor, shape, None, r, frames.gains)
    unknown = np.isnan(r)[:, None]
    return np.where(unknown, np.nan, seen.signal), np.where(unknown, np.nan, seen.by_range)


def background_light(sensor: Sensor, background: Quad, r: Array, frames: Frames) -> Array:
    """Return a background's readings behind an object.

    Parameters
    ----------
    background : (float, float, float, float)
        Strength [reading units], distance [m], c0' [m^2], c1' [m].
    r : ndarray, shape (n,)
        Ranges of the object [m].
    frames : Frames
        Their gain factors.

    Returns
    -------
    ndarray, shape (n, 2)
        nan where the range is.
    """
    dark = (1.0, 0.0, 0.0)
    seen = _light(sensor, dark, background, r, frames.gains)
    return np.where(np.isnan(r)[:, None], np.nan, seen.mean)
