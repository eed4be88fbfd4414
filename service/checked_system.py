"""From validated requests to checked arguments of the layers below."""

from simulator.errors import InvalidInputError, Problem, RefusedError
from simulator.frames import FrameColumns, Frames, frames_from_columns
from simulator.joint_scene import around
from simulator.scene import Scene
from simulator.scene_checks import check_scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["aliases_of", "checked_frames", "checked_system"]

# roots that an answer may hold: about a hundred megabytes
_MOST_ROOTS = 5_000_000


def checked_system(sensor: Sensor, scene: Scene) -> tuple[Sensor, Scene]:
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


def checked_frames(
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
    RefusedError
        Where the answer would have more roots than memory has room for.
    """
    problems: list[Problem] = []
    frames = None
    try:
        checked_system(sensor, scene)
    except InvalidInputError as error:
        problems += error.problems
    try:
        frames = frames_from_columns(sensor, columns)
    except InvalidInputError as error:
        problems += error.below("/frames").problems
    if problems or frames is None:
        raise InvalidInputError(*problems)
    _check_aliases(sensor, scene, len(frames))
    return sensor, scene, frames


def aliases_of(sensor: Sensor, scene: Scene) -> float:
    """Return how many roots a frame may have: as many as unambiguous ranges before a background.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        Of a request.
    """
    if isinstance(sensor, PulsedSensor) or scene.background is None:
        return 1.0
    if scene.joint is not None:
        return max(aliases_of(*each) for pair in around(sensor, scene) for each in pair)
    distance = scene.background.distance_m
    if not isinstance(distance, float | int):
        return 1.0
    return 1.0 + distance / sensor.max_range_m


def _check_aliases(sensor: Sensor, scene: Scene, n: int) -> None:
    """Refuse a background so many wavelengths away that every frame has a multitude of roots."""
    aliases = aliases_of(sensor, scene)
    if n * aliases > _MOST_ROOTS:
        raise RefusedError(
            f"the background lies {aliases:.3g} unambiguous ranges away, and each of {n} frames "
            "may have as many roots; lower the frequency or send fewer frames"
        )
