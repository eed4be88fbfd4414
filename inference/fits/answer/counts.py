"""Whether frames are enough for what is unknown, told before anything is fitted.

Every frame holds two readings and one range, so that one number is left for the unknowns; an empty
scene has no range, but shows nothing but the sum of crosstalk and background.
"""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.turns import MOST_TURNS, turns_of
from inference.fits.likelihood.unknowns import unknowns_of
from inference.known import Known
from inference.realtime.net import SATURATED, rule_out
from simulator.errors import listed
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = [
    "frames_needed",
    "joint_obstacle",
    "linear_obstacle",
    "ranges_needed",
    "too_few",
]

_MOST_FRAMES = 20_000


# how the two readings of an empty scene move with what they show, at no special place: crosstalk
# adds to one of them, the strength moves both, the distance of a pulse's background the first
_OF_EMPTY = {
    "crosstalk.w1": (1.0, 0.0),
    "crosstalk.w2": (0.0, 1.0),
    "crosstalk.i": (1.0, 0.0),
    "crosstalk.q": (0.0, 1.0),
    "background.strength": (0.6, 0.8),
}
_OF_DISTANCE = {"pulsed": (1.0, 0.0), "sine_wave": (-0.8, 0.6)}


def ranges_needed(kind: str, unknowns: tuple[str, ...], empty: bool) -> int:
    """Return how many distinct ranges determine the unknowns.

    Parameters
    ----------
    kind : str
        Of the sensor.
    unknowns : tuple of str
        Scene paths of what is unknown besides the ranges.
    empty : bool
        Whether there are frames without an object: they tell as many numbers as the rank of what
        moves their readings.
    """
    if not empty:
        return len(unknowns)
    moves = {**_OF_EMPTY, "background.distance_m": _OF_DISTANCE[kind]}
    shown = [moves[path] for path in unknowns if path in moves]
    return len(unknowns) - (int(np.linalg.matrix_rank(np.array(shown))) if shown else 0)


def frames_needed(kind: str, unknowns: tuple[str, ...], empty: bool) -> int:
    """Return the least number of frames with an object: one more than determines the unknowns.

    Parameters
    ----------
    kind : str
        Of the sensor.
    unknowns : tuple of str
        Scene paths of what is unknown besides the ranges.
    empty : bool
        Whether there are frames without an object.

    Returns
    -------
    int
        Exactly determined systems have several exact solutions, so one more is asked for.
    """
    return ranges_needed(kind, unknowns, empty) + 1


def too_few(frames: Frames | None, unknowns: tuple[str, ...]) -> str | None:
    """Return that frames are too few for a fit that takes one equation of each, None if not.

    Parameters
    ----------
    frames : Frames, optional
        Left out: enough are supposed.
    unknowns : tuple of str
        Scene paths of what is fitted.
    """
    needed = len(unknowns) + 1
    count = needed if frames is None else int(frames.present.sum())
    if count >= needed:
        return None
    return (
        f"needs at least {needed} frames with the object at different ranges for "
        f"{', '.join(unknowns)}, and has {count}; send more"
    )


def linear_obstacle(scene: Scene, unknowns: tuple[str, ...]) -> str | None:
    """Return why no fit linear in an object's numbers serves a scene, None if one does.

    Parameters
    ----------
    unknowns : tuple of str
        Scene paths of what is fitted.
    """
    if scene.motion == "tangential":
        return "needs a constant object, and the scene's amplitude changes"
    if scene.motion == "static" and len(unknowns) > 1:
        return (
            "needs an object whose range changes, and the scene's motion is static: one range "
            f"tells one of {listed(list(unknowns))}; move the object, or state all of them but one "
            "as known"
        )
    return None


def _told(frames: Frames, usable: NDArray[np.bool_]) -> int:
    """Return how many numbers are known of the ranges of frames, less the offset of odometry."""
    known, moved = (
        0 if column is None else int(np.count_nonzero(np.isfinite(column) & usable))
        for column in (frames.known_range_m, frames.displacement_m)
    )
    return known + max(moved - 1, 0)


def _turns_obstacle(sensor: Sensor, scene: Scene) -> str | None:
    """Return why no joint fit looks at all turns of phase of the stated ranges, None if it does."""
    law = parameters_of(sensor, scene).range_prior
    turns = turns_of(sensor, scene, (law.low, law.high))
    if turns > MOST_TURNS:
        return (
            f"the stated range_m holds {turns:.3g} turns of phase, and a joint fit decides between "
            f"{MOST_TURNS:g} at most; narrow it, take a lower frequency, or a posterior"
        )
    wall = None if scene.background is None else scene.background.distance_m
    if not turns > 1.0 or wall is None or isinstance(wall, float | int):
        return None
    of_wall = wall.distribution()
    if of_wall.high - of_wall.low <= sensor.max_range_m:
        return None
    return (
        f"the stated range_m goes on beyond {sensor.max_range_m:.4g} m, where the phase begins "
        "anew, and so does background.distance_m; state it as a number, or with a prior that ends "
        "within as much, or use a posterior"
    )


def joint_obstacle(
    sensor: Sensor, scene: Scene, _known: Known, frames: Frames | None
) -> str | None:
    """Return why no joint fit can be made, None if one can be tried.

    Parameters
    ----------
    _known : Known
        The scene's known numbers, not used.
    frames : Frames, optional
        Left out: enough are supposed.
    """
    if scene.motion != "radial":
        return (
            f"needs an object whose range changes, and the scene's motion is {scene.motion}; "
            "ranges, crosstalk and background cannot be told apart otherwise"
        )
    if scene.optional_terms:
        return (
            f"keeps every term, and the scene leaves {' and '.join(scene.optional_terms)} to the "
            "data; use a posterior"
        )
    unknowns = unknowns_of(sensor, scene)
    if not unknowns:
        return "nothing but the ranges is unknown: a technique of single frames serves"
    of_turns = _turns_obstacle(sensor, scene)
    if of_turns is not None:
        return of_turns
    if frames is None:
        return None
    if len(frames) > _MOST_FRAMES:
        return f"serves up to {_MOST_FRAMES} frames, not {len(frames)}; send a part of them"
    usable = rule_out(sensor, frames) != SATURATED
    empty = bool((usable & ~frames.present).any())
    objects = int(np.count_nonzero(usable & frames.present))
    told = _told(frames, usable & frames.present)
    needed = frames_needed(sensor.kind, unknowns, empty)
    law = parameters_of(sensor, scene).law
    if objects + told < needed and not (law is not None and set(unknowns) <= set(law.names)):
        return (
            f"needs at least {needed} unsaturated frames with the object at different ranges for "
            f"{', '.join(unknowns)}, and has {objects}; send more, state more numbers as known, "
            "or use a posterior with priors"
        )
    return None
