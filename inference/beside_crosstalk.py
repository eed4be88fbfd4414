"""What is supposed of light beside the object's: whether it flickers, and follows a gain."""

from collections.abc import Iterator

import numpy as np

from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["supposed_beside_crosstalk"]

_STEADY = (
    "noise.relative is taken for an error of the object's light alone: crosstalk and background do "
    'not flicker. If the source does, state "relative_of": "source" beside it, or ranges may be '
    'confident and wrong; "object" where the light does not'
)
_UNSCALED = (
    "gain differs between frames, and crosstalk is taken not to follow it, as of an offset of the "
    "electronics. Light of a cover glass follows the source, the exposure and an amplifier: then "
    "send all readings divided by gain, no column gain, and noise.read and noise.shot divided by "
    "the smallest gain, or ranges may be confident and wrong"
)


def supposed_beside_crosstalk(scene: Scene, sensor: Sensor, frames: Frames) -> Iterator[str]:
    """Yield, for a person, what readings tell nothing of and ranges depend on.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request. Of which light the relative error is, a sensor that says it is not asked.
    """
    noise, crosstalk = sensor.noise, scene.crosstalk_values is not None
    asked = noise.relative > 0.0 and "relative_of" not in noise.model_fields_set
    if asked and (crosstalk or scene.background is not None):
        yield _STEADY
    if crosstalk and frames.gain is not None and float(np.ptp(frames.gain)) > 0.0:
        yield _UNSCALED
