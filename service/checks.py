"""From validated requests to checked arguments of the layers below."""

from simulator.errors import InvalidInputError, Problem
from simulator.frames import FrameColumns, Frames, frames_from_columns
from simulator.scene import Scene, check_scene
from simulator.sensor import Sensor

__all__ = ["system", "system_with_frames"]


def system(sensor: Sensor, scene: Scene) -> tuple[Sensor, Scene]:
    """Check a scene against its sensor.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        Of a request.

    Returns
    -------
    tuple
        Both.

    Raises
    ------
    InvalidInputError
        With pointers below ``/scene``.
    """
    try:
        check_scene(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    return sensor, scene


def system_with_frames(
    sensor: Sensor, scene: Scene, columns: FrameColumns
) -> tuple[Sensor, Scene, Frames]:
    """Check a scene and frames against their sensor.

    Parameters
    ----------
    sensor, scene, columns : Sensor, Scene, FrameColumns
        Of a request.

    Returns
    -------
    tuple
        Sensor, scene and frames.

    Raises
    ------
    InvalidInputError
        With pointers below ``/scene`` and ``/frames``, of both at once.
    """
    problems: list[Problem] = []
    frames = None
    try:
        system(sensor, scene)
    except InvalidInputError as error:
        problems += error.problems
    try:
        frames = frames_from_columns(sensor, columns)
    except InvalidInputError as error:
        problems += error.below("/frames").problems
    if problems or frames is None:
        raise InvalidInputError(*problems)
    return sensor, scene, frames
