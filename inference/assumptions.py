"""What an answer supposes that no reading can test, and that moves ranges where it is wrong."""

import numpy as np

from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["assumptions_of", "unused_temperature"]

_OWN_SHADOW = (
    'the shadow is taken for the object\'s own (c0\' = c0, c1\' = c1), as "shadow": "object" says. '
    "That of a diffuse object has c0' near 0.75 c0, and ranges are then off without a misfit: "
    "leave `shadow` out to have it unknown, or state its c0 and c1"
)
_TEMPERATURE = (
    "gain and delay do not follow the temperature: temperature_k is given and not used, since the "
    "sensor states no coefficients in `temperature`"
)


def assumptions_of(scene: Scene, sensor: Sensor, frames: Frames) -> tuple[str, ...]:
    """Return what answers about a scene suppose without a check.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request.

    Returns
    -------
    tuple of str
        For a person; empty where everything is either stated in numbers or unknown.
    """
    supposed = (_OWN_SHADOW,) if scene.shadow_is_object else ()
    if sensor.temperature is None and frames.temperature_k is not None:
        supposed = (*supposed, _TEMPERATURE)
    return supposed


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
