"""Crosstalk as numbers, and what is open of them, whether it is stated so, as priors or a law."""

import math
from typing import NamedTuple

import numpy as np

from inference.known import known_of
from inference.stated_light import stated_light
from simulator.errors import RefusedError
from simulator.joint_scene import centre
from simulator.parameters import parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["CrosstalkInNumbers", "crosstalk_in_numbers"]

Pair = tuple[float, float]

_TAILS = (1.0, 2.0, 3.0, 4.0)  # standard deviations at which the width of a law is looked at


class CrosstalkInNumbers(NamedTuple):
    """What is subtracted, and what a prior or a joint law leaves open of it [reading units]."""

    values: Pair
    sd: Pair


def crosstalk_in_numbers(scene: Scene, sensor: Sensor) -> CrosstalkInNumbers | None:
    """Return the crosstalk in numbers.

    Returns
    -------
    CrosstalkInNumbers or None
        None where it is optional, or not known so.
    """
    light = stated_light(sensor, scene)
    stated, sd = (scene, (0.0, 0.0)) if light is None else (light.scene, light.sd)
    try:
        of, numbers = centre(sensor, stated)
        values = known_of(numbers, of).crosstalk
        if values is None:
            return None
        if stated.joint is not None:
            sd = _with_law(sensor, stated, sd)
    except RefusedError:
        return None
    return CrosstalkInNumbers(values, sd)


def _with_law(sensor: Sensor, scene: Scene, sd: Pair) -> Pair:
    """Add what a joint law leaves open of the crosstalk: as wide as its tails are."""
    assert scene.joint is not None  # noqa: S101  # see above
    parameters = parameters_of(sensor, scene)
    names = parameters.names
    directions = np.eye(len(names))[[names.index(name) for name in scene.joint.unknowns]]
    middle = parameters.natural(np.zeros((1, len(names))))
    reach = np.zeros((len(directions), len(names)))
    for times in (*_TAILS, *(-times for times in _TAILS)):
        moved = np.abs(parameters.natural(times * directions) - middle)
        reach = np.maximum(reach, moved / abs(times))
    whole = dict(zip(names, np.hypot.reduce(reach, axis=0).tolist(), strict=True))
    first, second = (whole.get(f"crosstalk.{column}", 0.0) for column in sensor.columns)
    return math.hypot(sd[0], first), math.hypot(sd[1], second)
