"""A sensor and the scene before it: what every request and every scene file holds."""

from typing import Annotated

import pydantic

from simulator.scene import Scene
from simulator.sensor import Sensor
from simulator.validated import Validated

__all__ = ["AnySensor", "SystemDescription"]

AnySensor = Annotated[Sensor, pydantic.Field(discriminator="kind")]


class SystemDescription(Validated):
    """A sensor and the scene before it."""

    sensor: AnySensor
    scene: Scene
