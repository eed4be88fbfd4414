"""What to do about unknowns that a tracker does not take."""

from collections.abc import Sequence

from simulator.scene import Scene

__all__ = ["remedy"]

_CALIBRATE = (
    "calibrate the scene (hybridtof calibrate) or let the stream (--calibrate, over HTTP "
    "`calibrate`)"
)
_DIFFERS = "as `discrepancy.flux` how far others are (0.7: half to twice the light)"
_SHADOW = "background.shadow."


def remedy(scene: Scene, unknown: Sequence[str]) -> str:
    """Return what to do about unknowns of a scene that a tracker does not take.

    Parameters
    ----------
    scene : Scene
        The scene. One that was calibrated for other objects (docs/scenes.md, other-objects) is not
        to be calibrated once more: its object is left open on purpose.
    unknown : sequence of str
        Scene paths.

    Returns
    -------
    str
        What follows a semicolon.
    """
    of_object = any(name.startswith("object.") for name in unknown)
    if _is_for_others(scene) and all(name.startswith(("object.", _SHADOW)) for name in unknown):
        shadow = () if scene.shadow is None or scene.shadow_is_object else scene.shadow
        known = all(isinstance(value, float | int) for value in shadow)
        and_its = "" if known else " and of its shadow"
        return (
            "the scene is calibrated for objects that differ: state the numbers of one object"
            f"{and_its}, and {_DIFFERS}"
        )
    differs = f"; of objects that differ, state one in numbers, and {_DIFFERS}"
    return _CALIBRATE + (differs if of_object else "")


def _is_for_others(scene: Scene) -> bool:
    """Tell whether a scene was calibrated, and kept nothing of the object."""
    if scene.joint is None:
        return scene.calibration is not None
    return not any(name.startswith("object.") for name in scene.joint.unknowns)
