"""Surfaces: what a scene is made of."""

import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.optics import marks
from simulator.optics.brdf import Material
from simulator.optics.vectors import Pose, Position
from simulator.validated import Validated

__all__ = ["Disk", "Plane", "Rectangle", "Shell", "Sphere", "Surface", "pack_surface"]

Array = NDArray[np.float64]
Length = Annotated[float, pydantic.Field(gt=0, ge=1e-12, le=1e12)]


class _Flat(Validated):
    pose: Pose
    material: Material = Material()

    def at(self, pose: Pose) -> "Surface":
        """Return the same surface elsewhere."""
        return self.model_copy(update={"pose": pose})  # type: ignore[return-value]


class Rectangle(_Flat):
    """A flat rectangle; both faces reflect.

    Attributes
    ----------
    width_m, height_m : float
        Along the pose's width axis and across it [m].
    pose : Pose
        Centre, normal and width axis.
    material : Material
        Reflectance.
    """

    kind: Literal["rectangle"] = "rectangle"
    width_m: Length
    height_m: Length


class Disk(_Flat):
    """A flat circular disk; both faces reflect.

    Attributes
    ----------
    radius_m : float
        [m].
    pose : Pose
        Centre and normal.
    material : Material
        Reflectance.
    """

    kind: Literal["disk"] = "disk"
    radius_m: Length


class Plane(_Flat):
    """An infinite plane.

    Attributes
    ----------
    pose : Pose
        Any of its points, and the normal.
    material : Material
        Reflectance.
    """

    kind: Literal["plane"] = "plane"


class Sphere(Validated):
    """A sphere seen from outside.

    Attributes
    ----------
    centre_m : (float, float, float)
        [m].
    radius_m : float
        [m].
    material : Material
        Reflectance.
    """

    kind: Literal["sphere"] = "sphere"
    centre_m: Position
    radius_m: Length
    material: Material = Material()

    def at(self, pose: Pose) -> "Sphere":
        """Return the same sphere with its centre at the pose's position."""
        return self.model_copy(update={"centre_m": pose.position_m})


class Shell(Validated):
    """A sphere seen from inside: the background around the sensor.

    Attributes
    ----------
    radius_m : float
        R [m]; emitter and detector must lie inside.
    centre_m : (float, float, float)
        [m].
    material : Material
        Reflectance.
    """

    kind: Literal["shell"] = "shell"
    radius_m: Length
    centre_m: Position = (0.0, 0.0, 0.0)
    material: Material = Material()


Surface = Annotated[Rectangle | Disk | Plane | Sphere, pydantic.Field(discriminator="kind")]


def pack_surface(surface: Rectangle | Disk | Plane | Sphere) -> Array:
    """Return the row of `simulator.optics.marks` for a surface."""
    row = np.zeros(15)
    if isinstance(surface, Sphere):
        row[0], row[13] = marks.ROUND, surface.radius_m
        row[1:4] = surface.centre_m
        return row
    u, v, n = surface.pose.axes()
    row[1:4], row[4:7], row[7:10], row[10:13] = surface.pose.position_m, u, v, n
    if isinstance(surface, Rectangle):
        row[0] = marks.RECTANGLE
        row[13], row[14] = 0.5 * surface.width_m, 0.5 * surface.height_m
    elif isinstance(surface, Disk):
        row[0], row[13] = marks.DISK, surface.radius_m
    else:
        row[0], row[13] = marks.PLANE, math.inf
    return row
