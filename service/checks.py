"""From validated requests to checked arguments of the layers below."""

from service.schemas import EstimateRequest, PosteriorRequest, SystemDescription
from simulator.errors import InvalidInputError, Problem
from simulator.frames import Frames, frames_from_columns
from simulator.scene import Scene, check_scene
from simulator.sensor import Sensor

__all__ = ["system", "system_with_frames"]


def system(request: SystemDescription) -> tuple[Sensor, Scene]:
    """Check a scene against its sensor.

    Parameters
    ----------
    request : SystemDescription
        Holds both.

    Returns
    -------
    tuple
        Sensor and scene.

    Raises
    ------
    InvalidInputError
        With pointers below ``/scene``.
    """
    try:
        check_scene(request.sensor, request.scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    return request.sensor, request.scene


def system_with_frames(
    request: EstimateRequest | PosteriorRequest,
) -> tuple[Sensor, Scene, Frames]:
    """Check a scene and frames against their sensor.

    Parameters
    ----------
    request : EstimateRequest or PosteriorRequest
        Holds all three.

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
        system(request)
    except InvalidInputError as error:
        problems += error.problems
    try:
        frames = frames_from_columns(request.sensor, request.frames)
    except InvalidInputError as error:
        problems += error.below("/frames").problems
    if problems or frames is None:
        raise InvalidInputError(*problems)
    return request.sensor, request.scene, frames
