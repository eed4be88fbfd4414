"""What techniques are called where people read."""

import re

__all__ = ["in_words", "said"]

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


def in_words(reason: str) -> str:
    """Return a reason with the names of techniques as `said` has them."""
    names = (name for name in _SAID if "_" in name)
    return re.sub(rf"\b({'|'.join(names)})\b", lambda found: f"the {said(found[0])}", reason)
