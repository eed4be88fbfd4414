"""Light of frames without the object that may be a wall's, and is taken for crosstalk."""

from simulator.frames import Frames
from simulator.scene import Scene

__all__ = ["TAKEN_FOR_CROSSTALK", "taken_for_crosstalk"]

TAKEN_FOR_CROSSTALK = (
    "light of empty frames is taken for crosstalk: if a wall stands behind the object, state a "
    "`background`, or ranges are off without a misfit"
)


def taken_for_crosstalk(scene: Scene, frames: Frames) -> bool:
    """Return whether crosstalk is learnt of empty frames that could show a wall as well."""
    if frames.object_present is None or scene.background is not None:
        return False
    values = scene.crosstalk_values
    if values is None or all(isinstance(value, float | int) for value in values):
        return False
    return "crosstalk" not in scene.optional_terms and not bool(frames.object_present.all())
