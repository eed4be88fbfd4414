"""The narrow limit: all light along one ray, which lights one point of a surface.

As int I_e d omega = Phi0 over the ray, dPhi = f_r cos_o cos_d / r_o^2 at the point it meets: no
quadrature is left.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.optics import marks
from simulator.optics.brdf import pack_material
from simulator.optics.detectors import Detector
from simulator.optics.emitters import Emitter
from simulator.optics.geometry import light_path
from simulator.optics.light import Light, Modulation, Status, along_one_path, dark
from simulator.optics.surfaces import Disk, Plane, Rectangle, Sphere, pack_surface

__all__ = ["observe_narrow"]

Array = NDArray[np.float64]


def _hit(surface: Array, origin: Array, direction: Array) -> tuple[float, Array] | None:
    """Return distance along the ray and outward normal where it meets the surface, or None."""
    arm = origin - surface[1:4]
    if surface[0] == marks.ROUND:
        radius = float(surface[13])
        along = -float(arm @ direction)
        size = float(np.linalg.norm(arm))
        if size <= radius:
            raise InvalidInputError.at("/surface", "emitter or detector lies inside the sphere")
        across2 = float(np.sum(np.cross(arm, direction) ** 2))
        if along <= 0 or across2 >= radius * radius:
            return None
        # the nearer root through the product of both
        far = along + math.sqrt(radius * radius - across2)
        distance = (size - radius) * (size + radius) / far
        return distance, (arm + distance * direction) / radius
    normal = surface[10:13]
    slope = float(direction @ normal)
    height = float(arm @ normal)
    if slope == 0 or -height / slope <= 0:
        return None
    distance = -height / slope
    point = arm + distance * direction
    x, y = float(point @ surface[4:7]), float(point @ surface[7:10])
    if surface[0] == marks.RECTANGLE:
        inside = abs(x) <= surface[13] and abs(y) <= surface[14]
    else:
        inside = math.hypot(x, y) <= surface[13]
    return (distance, normal if height > 0 else -normal) if inside else None


def observe_narrow(
    surface: Rectangle | Disk | Plane | Sphere,
    emitter: Emitter,
    detector: Detector,
    modulation: Modulation,
) -> Light:
    """Return what a surface sends when all light goes along the emitter's aim.

    Raises
    ------
    InvalidInputError
        If the emitter lies inside a sphere.
    """
    row, material = pack_surface(surface), pack_material(surface.material)
    origin, aim = np.array(emitter.position_m), np.array(emitter.aim)
    found = _hit(row, origin, aim)
    if found is None:
        return dark("out_of_view")
    distance, normal = found
    to_e = distance * aim
    to_d = origin + to_e - np.array(detector.position_m)
    height_i, height_o = -float(to_e @ normal), -float(to_d @ normal)
    if height_o < 0:
        return dark("opposite_faces")
    if height_i == 0 or height_o == 0:
        return dark("edge_on")
    # a pattern of intensity 1 in every direction; its cos_i / r_i^2 turns area into solid angle
    head = np.concatenate([origin, aim, detector.position_m, detector.normal, [0.0, 0.0, 1.0, 0.0]])
    value, ri, ro = light_path(
        head,
        np.zeros((3, 2)),
        material,
        0,
        (float(to_e[0]), float(to_e[1]), float(to_e[2])),
        (float(to_d[0]), float(to_d[1]), float(to_d[2])),
        (float(normal[0]), float(normal[1]), float(normal[2])),
        height_i,
        height_o,
    )
    flux = value * ri * ri * (ri / height_i) / (ro * ro)
    if flux == 0.0:
        status: Status = "out_of_view" if float(to_d @ head[9:12]) <= 0 else "dark"
        return dark(status)
    return along_one_path(flux, 0.5 * (ri + ro), modulation, "lit")
