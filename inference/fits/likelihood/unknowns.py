"""What is unknown in a scene, by scene path: all that an obstacle asks, without a kernel."""

from simulator.parameters import parameters_of
from simulator.remembered import remembered
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["paths_of", "unknowns_of"]


def paths_of(sensor: Sensor) -> tuple[str, ...]:
    """Return the scene paths of all values, in the order of `inference.frame.sensitivity.Value`."""
    first, second = sensor.columns
    return (
        "object.c0",
        "object.c1",
        "object.c2",
        f"crosstalk.{first}",
        f"crosstalk.{second}",
        "background.strength",
        "background.distance_m",
        "background.shadow.c0",
        "background.shadow.c1",
    )


@remembered
def unknowns_of(sensor: Sensor, scene: Scene) -> tuple[str, ...]:
    """Return the scene paths of everything unknown but the ranges.

    Parameters
    ----------
    sensor : Sensor
        Names the two crosstalks.
    scene : Scene
        The scene, checked.

    Returns
    -------
    tuple of str
        In the order object, crosstalk, background, shadow.
    """
    names = set(parameters_of(sensor, scene).names)
    return tuple(path for path in paths_of(sensor) if path in names)
