"""Whether surfaces hide one another, by rays to a coarse set of their points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulator.optics import marks
from simulator.optics.detectors import Detector
from simulator.optics.emitters import Emitter
from simulator.optics.surfaces import Disk, Plane, Rectangle, Sphere, pack_surface

__all__ = ["hidden_pair"]

Array = NDArray[np.float64]

_SIDE = 9


def _probes(surface: Array, eye: Array) -> Array:
    """Return points of a surface, shape (n, 3), its rim included."""
    steps = np.linspace(-1.0, 1.0, _SIDE)
    x, y = (a.ravel() for a in np.meshgrid(steps, steps))
    if surface[0] == marks.ROUND:
        axis = eye - surface[1:4]
        distance = float(np.linalg.norm(axis))
        axis = axis / distance
        side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        side = side / np.linalg.norm(side)
        # the visible cap
        angle = np.arccos(min(surface[13] / distance, 1.0)) * np.maximum(np.abs(x), np.abs(y))
        turn = np.arctan2(y, x)
        around = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side)
        points = np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * around
        return np.asarray(surface[1:4] + surface[13] * points)
    if surface[0] == marks.RECTANGLE:
        a, b = surface[13] * x, surface[14] * y
    else:
        # square onto disk ring by ring; an infinite plane is probed out to where it goes dark
        height = abs(float((eye - surface[1:4]) @ surface[10:13]))
        radius = surface[13] if surface[0] == marks.DISK else 20.0 * height
        ring, turn = radius * np.maximum(np.abs(x), np.abs(y)), np.arctan2(y, x)
        a, b = ring * np.cos(turn), ring * np.sin(turn)
    centre = surface[1:4]
    if surface[0] == marks.PLANE:
        centre = eye - ((eye - centre) @ surface[10:13]) * surface[10:13]
    return np.asarray(centre + a[:, None] * surface[4:7] + b[:, None] * surface[7:10])


def _blocked(surface: Array, eye: Array, points: Array) -> NDArray[np.bool_]:
    """Return for each point whether the surface crosses its line to the eye."""
    rays = points - eye
    clear = 1.0 - 1e-9
    if surface[0] == marks.ROUND:
        arm = eye - surface[1:4]
        a = np.einsum("ij,ij->i", rays, rays)
        b = rays @ arm
        c = float(arm @ arm) - float(surface[13]) ** 2
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        first = (-b - root) / a
        return np.asarray((b * b > a * c) & (first > 0) & (first < clear))
    slope = rays @ surface[10:13]
    height = float((eye - surface[1:4]) @ surface[10:13])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -height / slope
        hit = eye + share[:, None] * rays - surface[1:4]
        x, y = hit @ surface[4:7], hit @ surface[7:10]
    if surface[0] == marks.RECTANGLE:
        inside = (np.abs(x) < surface[13]) & (np.abs(y) < surface[14])
    else:
        inside = np.hypot(x, y) < surface[13]
    return np.asarray((slope != 0) & (share > 0) & (share < clear) & inside)


def hidden_pair(
    surfaces: Sequence[Rectangle | Disk | Plane | Sphere], emitter: Emitter, detector: Detector
) -> tuple[int, int] | None:
    """Return the first two surfaces of which the one hides the other, or None.

    Parameters
    ----------
    surfaces : sequence of surfaces
        Those of a scene.
    emitter, detector : Emitter, Detector
        From which lines of sight start; only points in front of them count.

    Notes
    -----
    81 points of each surface, the rim included, are tried: an overlap smaller than that mesh is
    not found.
    """
    if len(surfaces) < 2:
        return None
    rows = [pack_surface(surface) for surface in surfaces]
    for position, direction in (
        (emitter.position_m, emitter.aim),
        (detector.position_m, detector.normal),
    ):
        eye = np.array(position)
        for j, hidden in enumerate(rows):
            points = _probes(hidden, eye)
            points = points[(points - eye) @ np.array(direction) > 0]
            for i, front in enumerate(rows):
                if i != j and bool(np.any(_blocked(front, eye, points))):
                    return i, j
    return None
