"""What frames without the object say against what a scene states in numbers."""

import numpy as np
from numpy.typing import NDArray

from inference.known import known_of
from inference.realtime.net import ABSENT, rule_out
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["contradiction"]

Array = NDArray[np.float64]

# standard errors of the mean of the empty frames: of two columns a false alarm of 1e-6
_BEYOND = 5.0


def contradiction(scene: Scene, sensor: Sensor, frames: Frames) -> str | None:
    """Return how empty frames contradict what the scene states in numbers.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request.

    Returns
    -------
    str or None
        For a person; None where they agree within 5 standard errors, where there are none, and
        where the scene leaves open what they should read.
    """
    if frames.object_present is None:
        return None
    empty = frames.select(np.flatnonzero(rule_out(sensor, frames) == ABSENT))
    n = len(empty.readings)
    expected = _expected(scene, sensor, empty) if n else None
    if expected is None:
        return None
    said = []
    shot = sensor.noise.shot
    for k, column in enumerate(sensor.columns):
        mean, stated = float(empty.readings[:, k].mean()), float(expected[:, k].mean())
        variances = sensor.noise.read[k] ** 2 + shot * np.abs(expected[:, k])
        error = float(np.sqrt(variances.mean() / n))
        # readings are rounded, however little noise they have
        error = max(error, float(np.finfo(float).eps) * abs(stated))
        if abs(mean - stated) > _BEYOND * error:
            away = abs(mean - stated) / error
            said.append(f"{column} {mean:.4g} where {stated:.4g} is stated ({away:.2g} off)")
    if not said:
        return None
    remedy = "as numbers or as priors"
    if scene.background is None:
        remedy += ", or a `background` where a wall stands behind the object"
    return (
        f"the {n} empty frames (object_present false) contradict the scene: on average they read "
        f"{' and '.join(said)}, in standard errors of that mean. Ranges take this light for the "
        f"object's: state `crosstalk` {remedy}"
    )


def _expected(scene: Scene, sensor: Sensor, empty: Frames) -> Array | None:
    """Return what empty frames read by the scene's numbers, shape (n, 2); None: not all known."""
    known = known_of(scene, sensor)
    if known.crosstalk is None:
        return None
    expected = np.broadcast_to(np.asarray(known.crosstalk), empty.readings.shape)
    if scene.background is None:
        return expected
    if not known.has("background.strength", "background.distance_m"):
        return None
    delay = sensor.timing_offset_s if isinstance(sensor, PulsedSensor) else sensor.phase_offset_rad
    if sensor.temperature is not None or not isinstance(delay, float | int | None):
        return None
    # only a scene with a wall asks for it
    from inference.fits.linear.light import carrier

    distance = known.get("background.distance_m")
    if isinstance(sensor, PulsedSensor) and delay is not None:
        distance += sensor.known_shift_m
    light = known.get("background.strength") * empty.gains
    return expected + light[:, None] * carrier(sensor, np.full(light.size, distance))
