"""Sensors and scenes of tests of single frames."""

from typing import Any

import numpy as np

from simulator.frames import Frames
from simulator.sensor import Sensor, parse_sensor

PRIOR = {"prior": "lognormal", "median": 1.0, "sigma": 1.0}

UNKNOWN = [PRIOR, PRIOR]

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}

FAR = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}


def sensor_of(kind: str, **more: Any) -> Sensor:
    timing = {"pulse_width_s": 1e-7} if kind == "pulsed" else {"frequency_hz": 2e7}
    noise = {"read": [1e-6, 1e-6], "derivative": [1e-6, 1e-6]}
    return parse_sensor({"kind": kind, "noise": noise} | timing | more)


PULSED, SINE = sensor_of("pulsed"), sensor_of("sine_wave")


def frame(*pair: float) -> Frames:
    return Frames(np.array([pair]), time_s=np.array([0.0]))
