"""Vectors, directions and poses in three dimensions."""

import math
from typing import Annotated

import pydantic

from simulator.validated import Validated

__all__ = [
    "Pose",
    "Position",
    "Unit",
    "Vector",
    "cross",
    "dot",
    "normalised",
    "rotated",
]

Vector = tuple[float, float, float]


def normalised(vector: Vector) -> Vector:
    """Return the unit vector along ``vector``.

    Raises
    ------
    ValueError
        If its length is zero.
    """
    size = math.hypot(*vector)
    if size == 0.0:
        raise ValueError("a direction must not be the zero vector")
    x, y, z = (v / size for v in vector)
    again = math.hypot(x, y, z)  # subnormal lengths lose digits in the first division
    return x / again, y / again, z / again


Position = Annotated[Vector, pydantic.Strict(False)]
Unit = Annotated[Vector, pydantic.Strict(False), pydantic.AfterValidator(normalised)]


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def rotated(vector: Vector, axis: Vector, angle_rad: float) -> Vector:
    """Turn a vector about an axis by the right-hand rule (Rodrigues)."""
    k = normalised(axis)
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    side, along = cross(k, vector), dot(k, vector) * (1.0 - c)
    x, y, z = (v * c + w * s + u * along for v, w, u in zip(vector, side, k, strict=True))
    return x, y, z


class Pose(Validated):
    """Where a flat surface is and how it is turned.

    Attributes
    ----------
    position_m : (float, float, float)
        Its centre [m]; the default sensor sits at the origin and looks along +z.
    normal : (float, float, float)
        Normal of the face; both faces reflect, so the sign does not matter.
    width_axis : (float, float, float), optional
        Direction of the width, as far as it is orthogonal to the normal. Left out: the x axis, or
        the y axis for a normal within 25 degrees of x.
    """

    position_m: Position
    normal: Unit = (0.0, 0.0, -1.0)
    width_axis: Unit | None = None

    @pydantic.model_validator(mode="after")
    def _spans(self) -> "Pose":
        if self.width_axis and math.hypot(*cross(self.normal, self.width_axis)) < 1e-6:
            raise ValueError("normal and width_axis must not be parallel")
        return self

    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Return the orthonormal directions of width, height and normal."""
        width = self.width_axis
        if width is None:
            width = (1.0, 0.0, 0.0) if abs(self.normal[0]) < 0.9 else (0.0, 1.0, 0.0)
        v = normalised(cross(self.normal, width))
        return cross(v, self.normal), v, self.normal

    def moved(self, offset_m: Vector) -> "Pose":
        """Return the pose shifted by a vector [m]."""
        x, y, z = (p + o for p, o in zip(self.position_m, offset_m, strict=True))
        return self.model_copy(update={"position_m": (x, y, z)})

    def turned(self, axis: Vector, angle_rad: float, about_m: Vector | None = None) -> "Pose":
        """Return the pose rotated by the right-hand rule about its centre or another point."""
        centre = self.position_m
        if about_m is not None:
            arm = (
                centre[0] - about_m[0],
                centre[1] - about_m[1],
                centre[2] - about_m[2],
            )
            x, y, z = rotated(arm, axis, angle_rad)
            centre = (about_m[0] + x, about_m[1] + y, about_m[2] + z)
        return self.model_copy(
            update={
                "position_m": centre,
                "normal": normalised(rotated(self.normal, axis, angle_rad)),
                "width_axis": normalised(rotated(self.axes()[0], axis, angle_rad)),
            }
        )

    @classmethod
    def facing(cls, position_m: Vector, tilt_rad: float = 0.0) -> "Pose":
        """Return the pose of Appendix B's kind: centred there, facing the origin, then tilted.

        Parameters
        ----------
        position_m : (float, float, float)
            Centre [m], not the origin.
        tilt_rad : float
            Angle about the y axis away from facing the origin [rad].
        """
        toward = normalised((-position_m[0], -position_m[1], -position_m[2]))
        up = (0.0, 1.0, 0.0) if abs(toward[1]) < 0.9 else (0.0, 0.0, 1.0)
        width = normalised(cross(up, (-toward[0], -toward[1], -toward[2])))
        pose = cls(position_m=position_m, normal=toward, width_axis=width)
        return pose.turned((0.0, 1.0, 0.0), tilt_rad) if tilt_rad else pose
