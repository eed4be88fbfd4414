"""What techniques are called where people read."""

__all__ = ["said"]

_SAID = {
    "conventional": "time of flight alone",
    "intensity": "brightness",
    "intensity_w1": "brightness of the late window",
    "differential": "rates of change",
    "background_cancelling": "wall cancelled",
    "background_intensity": "wall subtracted by its shadow",
    "background_cancelling_differential": "wall cancelled, rates of change",
    "object_fit": "fit of the object",
    "crosstalk_fit": "fit of the crosstalk",
    "shadow_fit": "fit of the shadow",
    "joint_fit": "fit of everything",
}


def said(name: str) -> str:
    """Return what a technique is called where people read."""
    return _SAID.get(name, name.replace("_", " "))
