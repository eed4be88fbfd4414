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


# what stands in reasons that Python callers read too, and how a page says it
_PATHS = {
    "object.c0": "the object's size",
    "object.c1": "the object's shape",
    "object.c2": "the object's reflectance",
    "crosstalk.w1": "the crosstalk of the late window",
    "crosstalk.w2": "the crosstalk",
    "crosstalk.i": "the crosstalk's real part",
    "crosstalk.q": "the crosstalk's imaginary part",
    "background.strength": "the background's strength",
    "background.distance_m": "the background's distance",
    "background.shadow.c0": "the shadow's size",
    "background.shadow.c1": "the shadow's shape",
    "background.shadow": "the shadow",
    "range_m": "the ranges",
}
_PHRASES = {
    ' ("shadow": "object")': "",
    "use the method emcee": "take the posterior by walkers",
}


def in_words(reason: str) -> str:
    """Return a reason without names of code: techniques as `said` has them, unknowns in words."""
    words = {name: f"the {said(name)}" for name in _SAID if "_" in name} | _PATHS
    longest = sorted(words, key=len, reverse=True)
    names = "|".join(re.escape(name) for name in longest)
    for phrase, instead in _PHRASES.items():
        reason = reason.replace(phrase, instead)
    found = re.sub(rf"(?<![\w.])({names})(?![\w.]\w)", lambda one: words[one[0]], reason)
    return re.sub(r"(,[^,]+), ([^,]+) is not$", r"\1 and \2 are not", found)
