"""The part of a frame that is free of a background of known distance."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import END_BAND
from inference.realtime.net import Form, Net
from inference.realtime.solving.exact import cycles_phase, weighted_differences
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["free_light", "may_be_none"]

Array = NDArray[np.float64]


def free_light(sensor: Sensor, net: Net, distance_m: float) -> tuple[Array, Form]:
    """Return what a frame reads across the direction of a background.

    Of a pulse it is w2 - (r0/R) w1, of a sine wave - Im(x exp(-j(kR + offset))).

    Parameters
    ----------
    sensor : Sensor
        Its kind, delays taken off.
    net : Net
        Readings less crosstalk of n frames.
    distance_m : float
        The background's distance R [m].

    Returns
    -------
    ndarray, shape (n,)
        That part [reading units].
    Form
        Which sum of both readings it is.
    """
    if isinstance(sensor, PulsedSensor):
        free = weighted_differences(net.second, distance_m, net.first, sensor.r0) / distance_m
        return free, Form(-(sensor.r0 / distance_m), 1.0)
    angle = cycles_phase(sensor.frequency_hz, distance_m) + sensor.known_phase_rad
    cosine, sine = math.cos(angle), math.sin(angle)
    return weighted_differences(net.first, sine, net.second, cosine), Form(sine, -cosine)


def may_be_none(free: Array, variance: Array) -> NDArray[np.bool_]:
    """Return of which frames noise alone may be what is free of the background, shape (n,).

    A bare background read with such noise would be an object, far from the background and sure.

    Parameters
    ----------
    free, variance : ndarray, shape (n,)
        That part, and the variance that noise gives it.
    """
    return np.asarray(np.abs(free) < END_BAND * np.sqrt(variance))
