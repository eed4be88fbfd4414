"""The thesis's scenes by name: the 108 plates of Appendix B."""

import math
import re
from dataclasses import dataclass

from simulator.errors import InvalidInputError
from simulator.optics.brdf import ConstantFresnel, Material
from simulator.optics.surfaces import Rectangle
from simulator.optics.vectors import Pose

__all__ = ["APPENDIX_B", "PlateScene", "plate_scene"]

# k_s F of the tables; ((n - 1)/(n + 1))^2 at n = 10, of which only the product is fixed
# (docs/model.md, appendix-b)
_REFLECTANCE = (9 / 11) ** 2

_SIZES = (
    (1, 1), (2, 2), (4, 4), (8, 8), (16, 16), (1, 16), (2, 8), (8, 2), (16, 1)
)  # fmt: skip
_MATERIALS = {
    "R00": Material(diffuse=1.0),
    "R05": Material(
        diffuse=0.0,
        specular=1.0,
        roughness=0.5,
        fresnel=ConstantFresnel(reflectance=_REFLECTANCE),
    ),
    "R01": Material(
        diffuse=0.0,
        specular=1.0,
        roughness=0.1,
        fresnel=ConstantFresnel(reflectance=_REFLECTANCE),
    ),
}
_TILTS = {"T00": 0.0, "T12": math.pi / 12, "T06": math.pi / 6, "T04": math.pi / 4}
_CODE = re.compile(r"W(\d\d)H(\d\d)(R\d\d)(T\d\d)")


@dataclass(frozen=True, slots=True)
class PlateScene:
    """A plate that moves along a ray from the sensor, facing it.

    Attributes
    ----------
    code : str
        Twelve characters, e.g. W04H08R00T12.
    width_m, height_m : float
        [m].
    material : Material
        Reflectance.
    tilt_rad : float
        Zenith angle of the plate's centre and of its normal [rad].
    """

    code: str
    width_m: float
    height_m: float
    material: Material
    tilt_rad: float

    def plate(self, distance_m: float) -> Rectangle:
        """Return the true rectangle whose plane cuts the sensor's axis at a distance [m].

        Its centre is the foot of the perpendicular from the sensor (docs/model.md, appendix-b).
        """
        s, c = math.sin(self.tilt_rad), math.cos(self.tilt_rad)
        height = distance_m * c
        return Rectangle(
            width_m=self.width_m,
            height_m=self.height_m,
            material=self.material,
            pose=Pose(
                position_m=(height * s, 0.0, height * c),
                normal=(-s, 0.0, -c),
                width_axis=(c, 0.0, -s),
            ),
        )


def plate_scene(code: str) -> PlateScene:
    """Return the plate of a scene code.

    Parameters
    ----------
    code : str
        Width and height in decimetres, reflectance R00 (diffuse), R05, R01 (Beckmann m = 0.5,
        0.1), tilt T00, T12, T06, T04 (pi/12, pi/6, pi/4).

    Raises
    ------
    InvalidInputError
        If the code is not of that form.
    """
    found = _CODE.fullmatch(code)
    if found is None or found[3] not in _MATERIALS or found[4] not in _TILTS:
        raise InvalidInputError.at("/code", f"{code!r} is not a scene code such as W04H08R00T12")
    width, height = int(found[1]) / 10, int(found[2]) / 10
    if not (width > 0 and height > 0):
        raise InvalidInputError.at("/code", f"{code!r} has no area")
    return PlateScene(code, width, height, _MATERIALS[found[3]], _TILTS[found[4]])


APPENDIX_B: tuple[PlateScene, ...] = tuple(
    plate_scene(f"W{w:02d}H{h:02d}{r}{t}") for t in _TILTS for r in _MATERIALS for w, h in _SIZES
)
