"""What an answer supposes without a check, and what looks like a mistake in what is stated."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.beside_crosstalk import supposed_beside_crosstalk
from inference.empty_scatter import scatter_of_empty
from inference.frame.taken_for_crosstalk import TAKEN_FOR_CROSSTALK, taken_for_crosstalk
from inference.growing_light import growing_light
from inference.impossible_light import impossible_light
from inference.known import known_of
from inference.smoothed_readings import smoothed_readings
from inference.stuck_readings import stuck_readings
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["assumptions_of", "doubtful_unit", "unused_temperature"]

_OWN_SHADOW = (
    'the shadow is taken for the object\'s own (c0\' = c0, c1\' = c1), as "shadow": "object" says. '
    "That of a diffuse object has c0' near 0.75 c0, and ranges are then off without a misfit: "
    "leave `shadow` out to have it unknown, or state its c0 and c1"
)
_TEMPERATURE = (
    "gain and delay do not follow the temperature: temperature_k is given and not used, since the "
    "sensor states no coefficients in `temperature`"
)
# unambiguous ranges that a sensor of this kind may have [m]: it ends neither where scenes begin by
# default nor beyond a horizon
_SHORTEST, _LONGEST = 2e-2, 3e3
# turns of phase of which no frame tells which it is; in millimetres as much is within the first
_TURNS, _MILLI = 10.0, 1e3
_TURN = 2 * math.pi * (1 + 1e-6)  # of a whole turn that was typed with seven digits
# temperatures at which no sensor is run [K]
_COLDEST_K, _HOTTEST_K = 200.0, 500.0
_TIMES = (
    "time_s does not increase from frame to frame: frames may be out of order, or of two logs; "
    "what asks for derivatives refuses them"
)


def assumptions_of(scene: Scene, sensor: Sensor, frames: Frames) -> tuple[str, ...]:
    """Return what answers about a scene suppose without a check.

    Returns
    -------
    tuple of str
        For a person; empty where everything is either stated in numbers or unknown, and nothing
        looks like a mistake.
    """
    supposed: tuple[str, ...] = ()
    doubt = impossible_light(scene, sensor, frames) or growing_light(scene, sensor, frames)
    if doubt:
        supposed = (doubt,)
    if doubt := stuck_readings(sensor, frames) or smoothed_readings(sensor, frames):
        supposed = (*supposed, doubt)
    if scene.shadow_is_object:
        supposed = (*supposed, _OWN_SHADOW)
    if sensor.temperature is None and frames.temperature_k is not None:
        supposed = (*supposed, _TEMPERATURE)
    if frames.temperature_k is not None and (doubt := _doubtful_temperature(frames.temperature_k)):
        supposed = (*supposed, doubt)
    if frames.time_s is not None and bool((np.diff(frames.time_s) <= 0).any()):
        supposed = (*supposed, _TIMES)
    if taken_for_crosstalk(scene, frames):
        supposed = (*supposed, TAKEN_FOR_CROSSTALK)
    supposed = (*supposed, *supposed_beside_crosstalk(scene, sensor, frames))
    if doubt := scatter_of_empty(sensor, frames):
        supposed = (*supposed, doubt)
    if doubt := doubtful_unit(sensor):
        supposed = (*supposed, doubt)
    if doubt := _doubtful_ranges(sensor, scene):
        supposed = (*supposed, doubt)
    return supposed


def _doubtful_ranges(sensor: Sensor, scene: Scene) -> str | None:
    """Return the doubt whether `range_m` is in metres, None without one.

    Ranges of a pulse that end beyond its reach are refused.
    """
    end, turn = known_of(scene, sensor).stated_end_m, sensor.max_range_m
    if end is None or not _TURNS * turn <= end <= _MILLI * turn:
        return None
    return (
        f"range_m goes on to {end:.4g}, and phases begin anew each {turn:.3g} m: is it in metres?"
    )


def _doubtful_temperature(temperature_k: NDArray[np.float64]) -> str | None:
    """Return the doubt whether temperatures are in kelvin, None without one."""
    odd = np.flatnonzero((temperature_k < _COLDEST_K) | (temperature_k > _HOTTEST_K))
    if not odd.size:
        return None
    return (
        f"temperature_k is {temperature_k[odd[0]]:g} in frame {int(odd[0])}: is it in kelvin? "
        "25 degrees Celsius are 298.15"
    )


def doubtful_unit(sensor: Sensor) -> str | None:
    """Return the doubt whether a sensor's time or frequency is in its unit, None without one.

    Parameters
    ----------
    sensor : Sensor
        As stated.
    """
    farthest = sensor.max_range_m
    if doubt := _doubtful_phase(sensor):
        return doubt
    if _SHORTEST <= farthest <= _LONGEST:
        return None
    if isinstance(sensor, PulsedSensor):
        stated, unit = f"pulse_width_s {sensor.pulse_width_s:g}", "seconds"
    else:
        stated, unit = f"frequency_hz {sensor.frequency_hz:g}", "hertz"
    return f"{stated} gives an unambiguous range of {farthest:.3g} m: is it in {unit}?"


def _doubtful_phase(sensor: Sensor) -> str | None:
    """Return the doubt whether a phase offset is in radians, None without one."""
    if isinstance(sensor, PulsedSensor) or not isinstance(sensor.phase_offset_rad, float | int):
        return None
    if abs(sensor.phase_offset_rad) <= _TURN:
        return None
    return (
        f"phase_offset_rad {sensor.phase_offset_rad:g} is more than a turn, 2 pi: is it in radians?"
    )


def unused_temperature(sensor: Sensor, frames: Frames) -> tuple[int, str] | None:
    """Return the first frame that tells a temperature which nothing uses, and what that supposes.

    Parameters
    ----------
    sensor, frames : Sensor, Frames
        Some frames of a stream.
    """
    if sensor.temperature is not None or frames.temperature_k is None:
        return None
    told = np.flatnonzero(np.isfinite(frames.temperature_k))
    return (int(told[0]), _TEMPERATURE) if told.size else None
