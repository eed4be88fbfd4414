"""A scene with a joint law, and its sensor, in known numbers: at its centre, and around it.

Plans, techniques and requests ask for both again and again: those of the last scenes are kept.
"""

import functools

import numpy as np
from numpy.typing import NDArray

from simulator.errors import RefusedError, listed
from simulator.parameters import parameters_of
from simulator.scene import Scene, Shadow
from simulator.sensor import Sensor
from simulator.sensor_unknowns import with_numbers
from simulator.validated import is_number

__all__ = ["around", "centre"]

Array = NDArray[np.float64]


def centre(sensor: Sensor, scene: Scene) -> tuple[Sensor, Scene]:
    """Return sensor and scene with the numbers at the centre of the scene's joint law.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene, checked.

    Returns
    -------
    (Sensor, Scene)
        Without a joint law; they themselves where the scene has none.

    Raises
    ------
    RefusedError
        Where a number is beyond what can be computed with.
    """
    return (sensor, scene) if scene.joint is None else _centre(sensor, scene)


@functools.lru_cache(maxsize=16)
def _centre(sensor: Sensor, scene: Scene) -> tuple[Sensor, Scene]:
    parameters = parameters_of(sensor, scene)
    origin = np.zeros((1, len(parameters)))
    return _at(sensor, scene, parameters.names, parameters.natural(origin)[0])


@functools.lru_cache(maxsize=16)
def around(
    sensor: Sensor, scene: Scene
) -> tuple[tuple[tuple[Sensor, Scene], tuple[Sensor, Scene]], ...]:
    """Return both a standard deviation off the centre on either side, a pair a direction.

    The directions are independent of one another under the joint law.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene, checked, with a joint law.

    Returns
    -------
    tuple of ((Sensor, Scene), (Sensor, Scene))
        Without joint laws.

    Raises
    ------
    RefusedError
        As of `centre`.
    """
    assert scene.joint is not None  # noqa: S101  # see above
    parameters = parameters_of(sensor, scene)
    names = parameters.names
    steps = np.eye(len(names))[[names.index(name) for name in scene.joint.unknowns]]
    plus, minus = parameters.natural(steps), parameters.natural(-steps)
    return tuple(
        (_at(sensor, scene, names, up), _at(sensor, scene, names, down))
        for up, down in zip(plus, minus, strict=True)
    )


def _at(
    sensor: Sensor, scene: Scene, names: tuple[str, ...], values: Array
) -> tuple[Sensor, Scene]:
    """Put numbers in place of what the joint law names."""
    assert scene.joint is not None  # noqa: S101  # its callers have seen to it
    numbers = {
        name: value
        for name, value in zip(names, values.tolist(), strict=True)
        if name in scene.joint.unknowns
    }
    beyond = [name for name, value in numbers.items() if not is_number(value)]
    if beyond:
        raise RefusedError(
            f"within a standard deviation of the scene's joint law {listed(beyond)} is beyond what "
            "can be computed with; calibrate with frames that tell it, or state a narrower prior"
        )

    def of(path: str) -> dict[str, float]:
        return {
            name.removeprefix(path): value
            for name, value in numbers.items()
            if name.startswith(path) and "." not in name.removeprefix(path)
        }

    changes: dict[str, object] = {"joint": None, "calibration": None}
    changes["object"] = scene.object.model_copy(update=of("object."))
    if scene.crosstalk_values is not None:
        light = of("crosstalk.")
        changes["crosstalk"] = tuple(
            light.get(column, value)
            for column, value in zip(sensor.columns, scene.crosstalk_values, strict=True)
        )
    if scene.background is not None:
        update: dict[str, object] = dict(of("background."))
        shadow = of("background.shadow.")
        if shadow and isinstance(scene.background.shadow, Shadow):
            update["shadow"] = scene.background.shadow.model_copy(update=shadow)
        changes["background"] = scene.background.model_copy(update=update)
    return with_numbers(sensor, numbers), scene.model_copy(update=changes)
