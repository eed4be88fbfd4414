"""The one thing to do first where no technique has a range, in place of fourteen reasons."""

import dataclasses

import numpy as np

from inference.estimates import LeftOut
from inference.fits.answer.counts import frames_needed
from inference.fits.likelihood.unknowns import unknowns_of
from inference.known import known_of
from inference.plan import Plan, obstacle, plan
from inference.realtime.net import ABSENT, SATURATED, rule_out
from inference.techniques import ALL_TECHNIQUES
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["beyond_bounds", "first_step"]

_EMPTY = 5  # frames without the object: they bound constant light by the sensor's own noise
_FIT = "joint_fit"
_OF_LIGHT = ("crosstalk", "background.")
_POSTERIOR = "ask for a posterior (hybridtof infer, POST /v1/posteriors)"


def first_step(
    sensor: Sensor, scene: Scene, frames: Frames, choice: Plan, refused: LeftOut | None
) -> str:
    """Return what to do first about a request that no technique has a result for.

    Parameters
    ----------
    choice : Plan
        What would serve it.
    refused : LeftOut, optional
        A technique that serves the scene, and found that the frames do not tell enough.

    Returns
    -------
    str
        One sentence for a person. That more frames would make a fit serve is not guessed: the fit
        is asked with that many.
    """
    state = rule_out(sensor, frames)
    empty = int(np.count_nonzero(state == ABSENT))
    objects = int(np.count_nonzero(state == 0))
    if not objects:
        lost = "are saturated: send less light" if np.any(state == SATURATED) else "are empty"
        return f"send frames that show the object: all of these {lost}"
    if choice.chosen is not None and refused is None:
        return f"ask for {choice.chosen}, or name no technique: it serves this scene"
    told = () if scene.joint is None else scene.joint.unknowns
    if not set(sensor.unknown) <= set(told):
        return (
            "calibrate the sensor, which states priors: take frames at ranges that a ruler tells "
            "(known_range_m, known_range_sd_m), and hybridtof calibrate makes a scene of them"
        )
    if scene.optional_terms:
        return f"{_POSTERIOR}: it decides whether {' and '.join(scene.optional_terms)} stays"
    if scene.motion == "tangential":  # which a posterior refuses
        timed = plan(sensor, scene).chosen
        if timed is not None:
            return f"give time_s, or derivative columns: {timed} then serves"
        return "state crosstalk and background as numbers: hybridtof calibrate learns them"
    if sensor.unknown:  # of a calibrated scene: what takes their law takes what else it has
        return _POSTERIOR
    return _more_frames(sensor, scene, objects, empty, refused)


def beyond_bounds(sensor: Sensor, scene: Scene, frames: Frames, name: str) -> str:
    """Return what to do first about a technique that tells bounds, since the object is unknown.

    Parameters
    ----------
    name : str
        The technique.

    Returns
    -------
    str
        One sentence for a person.
    """
    known = known_of(scene, sensor)
    if obstacle(ALL_TECHNIQUES[_FIT], sensor, scene, known, frames) is None:
        return f"{name} tells bounds alone: ask for {_FIT}, which tells ranges of these frames"
    state = rule_out(sensor, frames)
    empty, objects = (int(np.count_nonzero(state == of)) for of in (ABSENT, 0))
    if scene.motion != "radial" or scene.optional_terms:
        return f"{name} tells bounds alone: state the object's c0 and c1, or {_POSTERIOR}"
    return f"{name} tells bounds alone: {_more_frames(sensor, scene, objects, empty, None)}"


def _more_frames(
    sensor: Sensor, scene: Scene, objects: int, empty: int, refused: LeftOut | None
) -> str:
    """Return of what there are too few frames; a posterior, where more do not help."""
    unknowns = unknowns_of(sensor, scene)
    dark = any(name.startswith(_OF_LIGHT) for name in unknowns)
    needed = max(frames_needed(sensor.kind, unknowns, dark or empty > 0), objects)
    more = f"{needed} frames of the object at different ranges (there are {objects})"
    served = _serves(sensor, scene, needed, max(empty, _EMPTY if dark else 0))
    if dark and empty < _EMPTY:
        step = f"take {_EMPTY} frames without the object (object_present false)"
        if not served:
            return f"{step}, send them along, and {_POSTERIOR}"
        if needed > objects:
            return f"{step} and {more}, and send them together: {_FIT} then serves"
        if refused is not None:  # of its own accord: nothing says that light was all it lacked
            again = f"ask {_FIT} again" if refused.name == _FIT else f"ask {_FIT}"
            return f"{step}, send them along and {again}: {refused.name} says that {refused.reason}"
        return f"{step} and send them along: {_FIT} then serves"
    if served and needed > objects:
        return f"take {more}, and send them together: {_FIT} then serves"
    if refused is not None:
        return f"{_POSTERIOR}: {refused.name} {refused.reason}"
    return _POSTERIOR


def _serves(sensor: Sensor, scene: Scene, objects: int, empty: int) -> bool:
    """Tell whether a fit over many frames would take that many."""
    present = np.arange(objects + empty) < objects
    frames = Frames(np.zeros((objects + empty, 2)), object_present=present)
    if sensor.temperature is not None:
        warm = np.full(len(frames), sensor.temperature.reference_k)
        frames = dataclasses.replace(frames, temperature_k=warm)
    known = known_of(scene, sensor)
    return obstacle(ALL_TECHNIQUES[_FIT], sensor, scene, known, frames) is None
