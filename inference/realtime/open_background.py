"""What a joint law leaves open of a background behind a root."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import NOISE_BAND, Candidates
from inference.realtime.model_error import model_error_of
from inference.technique import Task
from simulator.object_arrays import object_fluxes, quadratics
from simulator.sensor import SineWaveSensor

__all__ = ["OpenBackground", "SeenScene", "Wave", "left_open", "or_none", "seen_scene"]

Array = NDArray[np.float64]


class Wave(NamedTuple):
    """Wave number [1/m] and the background's distance [m]."""

    number: float
    distance: float


class SeenScene(NamedTuple):
    """What the background is computed from: gain c2, c0, c1, its strength, the relative error.

    An error of the model's flux acts as one of the signal does.
    """

    gain: float
    c0: float
    c1: float
    strength: float
    relative: float


class OpenBackground(NamedTuple):
    """What a joint law leaves open, standard deviations in reading units.

    Attributes
    ----------
    light : ndarray, shape (n, m)
        Of the background that a root leaves of a frame.
    left : ndarray, shape (n, m)
        Of its strength less that: it is shared, so that much of it may cancel.
    free : ndarray, shape (n,)
        Of the part of a frame that is free of background, as far as readings and not the object
        tell it.
    """

    light: Array
    left: Array
    free: Array


def seen_scene(task: Task, relative: float) -> tuple[SeenScene, Wave | None]:
    """Return what the background is computed from.

    Parameters
    ----------
    task : Task
        Its scene has an object and a background in numbers.
    relative : float
        Relative standard deviation of the object's signal.
    """
    sensor, known = task.sensor, task.known
    scene = SeenScene(
        gain=sensor.known_gain * known.get("object.c2"),
        c0=known.get("object.c0"),
        c1=known.get("object.c1"),
        strength=known.get("background.strength"),
        relative=math.hypot(relative, model_error_of(task).flux),
    )
    if not isinstance(sensor, SineWaveSensor):
        return scene, None
    return scene, Wave(sensor.wave_number, known.get("background.distance_m"))


def left_open(
    task: Task, light: Callable[[Task], tuple[Array, Array]], roots: Array, slopes: Array
) -> OpenBackground:
    """Return what the scene's joint law leaves open of the background behind each root.

    Parameters
    ----------
    task : Task
        At the law's centre, with those around it.
    light : callable
        A task to a frame's part that is free of background and the one that holds all of it, each
        of shape (n,), in reading units.
    roots : ndarray, shape (n, m)
        Ranges [m].
    slopes : ndarray, shape (n, m)
        Of the free part, there [reading units / m].

    Returns
    -------
    OpenBackground
        Zero without a joint law. Of both sides of a direction the larger change counts: a law that
        is bent moves the background by more to one of them.
    """
    below, above, own = np.zeros_like(roots), np.zeros_like(roots), np.zeros(len(roots))
    if not task.around:
        return OpenBackground(below, above, own)
    with np.errstate(all="ignore"):
        lever = _change(task, roots) / slopes
        seen = light(task)
        background = _behind(task, seen, roots, lever)
        left = task.known.get("background.strength") - background
        for pair in task.around:
            of = [light(side) for side in pair]
            own += np.square(np.maximum(*(np.abs(free - seen[0]) for free, _ in of)))
            moved = [_behind(side, each, roots, lever) for side, each in zip(pair, of, strict=True)]
            rest = [
                side.known.get("background.strength") - other
                for side, other in zip(pair, moved, strict=True)
            ]
            below += np.square(np.maximum(*(np.abs(other - background) for other in moved)))
            above += np.square(np.maximum(*(np.abs(other - left) for other in rest)))
        return OpenBackground(np.sqrt(below), np.sqrt(above), np.sqrt(own))


def or_none(candidates: Candidates, free: Array, open_: OpenBackground) -> Candidates:
    """Return candidates whose error is no number where the light may be none by the law.

    Parameters
    ----------
    candidates : Candidates
        Of n frames.
    free : ndarray, shape (n,)
        The light of each that is free of background [reading units].
    open_ : OpenBackground
        Its standard deviation.
    """
    dark = np.abs(free) < NOISE_BAND * open_.free
    if not dark.any():
        return candidates
    noise = np.where(dark[:, None], np.inf, candidates.noise)
    return dataclasses.replace(candidates, noise=noise)


def _behind(task: Task, seen: tuple[Array, Array], roots: Array, lever: Array) -> Array:
    """Return the background behind roots that follow a task's numbers to first order, (n, m)."""
    free, whole = seen
    scene, wave = seen_scene(task, 0.0)
    flux = object_fluxes(roots, scene.gain * scene.c0, scene.c0, scene.c1)
    if wave is None:
        own, part = flux * (1.0 - roots / task.known.get("background.distance_m")), flux
    else:
        angle = wave.number * (wave.distance - roots)
        own, part = flux * np.sin(angle), flux * np.cos(angle)
    return np.asarray(whole[:, None] - part - lever * (free[:, None] - own))


def _change(task: Task, roots: Array) -> Array:
    """Return the slope of the object's part of what holds all of the background, shape (n, m)."""
    scene, wave = seen_scene(task, 0.0)
    flux = object_fluxes(roots, scene.gain * scene.c0, scene.c0, scene.c1)
    q = quadratics(roots, scene.c0, scene.c1)
    change = -flux * (2.0 + roots * (2.0 * roots + scene.c1) / q) / roots
    if wave is None:
        return np.asarray(change)
    angle = wave.number * (wave.distance - roots)
    return np.asarray(change * np.cos(angle) + wave.number * flux * np.sin(angle))
