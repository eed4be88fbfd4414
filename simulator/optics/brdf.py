"""Bidirectional reflectance: Lambertian, Torrance-Sparrow, and their mixture (2.6-2.10).

f_r = k_d / pi + k_s D G F / (4 cos_i cos_o), with the Beckmann distribution D, a geometric
attenuation G and the Fresnel factor F. Kernels return f_r cos_i cos_o, which is finite at grazing
angles where f_r is not.
"""

import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.validated import Validated

__all__ = [
    "ConstantFresnel",
    "Dielectric",
    "Material",
    "beckmann",
    "diffuse",
    "fresnel_dielectric",
    "pack_material",
    "reflect",
    "smith_lambda",
    "v_cavity",
]

Array = NDArray[np.float64]
NonNegative = Annotated[float, pydantic.Field(ge=0)]

V_CAVITY, SMITH, UNMASKED = 0.0, 1.0, 2.0
_MASKINGS = {"v_cavity": V_CAVITY, "smith": SMITH, "none": UNMASKED}


@compiled
def beckmann(cosine: float, tangent2: float, m: float) -> float:
    """Return the Beckmann distribution D [1/sr] (2.8).

    Parameters
    ----------
    cosine : float
        n . h, positive.
    tangent2 : float
        tan^2 of the angle between n and h; given apart because 1 - cosine^2 cancels.
    m : float
        Root mean square slope of the microfacets.
    """
    exponent = tangent2 / (m * m)
    if exponent > 745.0:  # exp underflows to zero
        return 0.0
    c2 = cosine * cosine
    return math.exp(-exponent) / (math.pi * m * m * c2 * c2)


@compiled
def fresnel_dielectric(cosine: float, index: float) -> float:
    """Return the reflectance of unpolarised light at a dielectric.

    Parameters
    ----------
    cosine : float
        Cosine of the angle of incidence.
    index : float
        Relative refractive index n >= 1.

    Notes
    -----
    R. L. Cook and K. E. Torrance, Computer Graphics 15(3), 1981, eq. for F.
    """
    g = math.sqrt(index * index + cosine * cosine - 1.0)
    down, up = g - cosine, g + cosine
    if up == 0.0:  # grazing incidence without a change of index
        return 0.0
    # g - c through the difference of squares: n -> 1 loses no digits
    down = (index - 1.0) * (index + 1.0) / up
    ratio = (cosine * up - 1.0) / (cosine * down + 1.0)
    return 0.5 * ((down / up) * (down / up)) * (1.0 + ratio * ratio)


@compiled
def smith_lambda(tangent2: float, m: float) -> float:
    """Return Smith's Lambda of the Beckmann distribution; its masking is G1 = 1 / (1 + Lambda).

    Notes
    -----
    B. Walter et al., Eurographics Symposium on Rendering 2007: with a = 1 / (m tan theta),
    Lambda = (erf(a) - 1)/2 + exp(-a^2) / (2 a sqrt(pi)).
    """
    if tangent2 <= 0.0:
        return 0.0
    a = 1.0 / (m * math.sqrt(tangent2))
    if a > 26.0:
        return 0.0
    return 0.5 * (math.exp(-a * a) / (a * math.sqrt(math.pi)) - math.erfc(a))


@compiled
def v_cavity(cosine: float, cosine_h: float, cosine_wh: float) -> float:
    """Return the masking of symmetric V-cavities, min(1, 2 (n.h)(n.w) / (w.h))."""
    return min(1.0, 2.0 * cosine_h * cosine / cosine_wh)


@compiled
def reflect(
    material: Array,
    at: int,
    cos_i: float,
    cos_o: float,
    cos_h: float,
    tan2_h: float,
    cos_wh: float,
) -> float:
    """Return f_r cos_i cos_o [1/sr].

    Parameters
    ----------
    material : ndarray
        As packed by `pack_material`.
    at : int
        Where in the array it begins.
    cos_i, cos_o : float
        Cosines of incidence and exit, positive.
    cos_h, tan2_h : float
        Cosine and squared tangent of the angle between the normal and the half vector.
    cos_wh : float
        Cosine between either direction and the half vector.
    """
    value = material[at] * cos_i * cos_o / math.pi
    if material[at + 1] > 0.0 and cos_h > 0.0:
        m = material[at + 2]
        d = beckmann(cos_h, tan2_h, m)
        if d > 0.0:
            g = 1.0
            if material[at + 5] == V_CAVITY:
                g = v_cavity(min(cos_i, cos_o), cos_h, cos_wh)
            elif material[at + 5] == SMITH:
                g = 1.0 / (
                    1.0
                    + smith_lambda(1.0 / (cos_i * cos_i) - 1.0, m)
                    + smith_lambda(1.0 / (cos_o * cos_o) - 1.0, m)
                )
            f = material[at + 4]
            if material[at + 3] > 0.0:
                f = fresnel_dielectric(cos_wh, f)
            value += 0.25 * material[at + 1] * d * g * f
    return float(value)


class ConstantFresnel(Validated):
    """A reflectance that does not depend on the angle.

    Attributes
    ----------
    reflectance : float
        Between 0 and 1.
    """

    kind: Literal["constant"] = "constant"
    reflectance: Annotated[float, pydantic.Field(ge=0, le=1)] = 1.0


class Dielectric(Validated):
    """Unpolarised Fresnel reflectance of a dielectric.

    Attributes
    ----------
    refractive_index : float
        Relative to the medium of the light, at least 1.
    """

    kind: Literal["dielectric"] = "dielectric"
    refractive_index: Annotated[float, pydantic.Field(ge=1)] = 1.5


class Material(Validated):
    """Reflectance of a surface: k_d Lambertian and k_s Torrance-Sparrow (2.10).

    Attributes
    ----------
    diffuse : float
        k_d, the albedo of the Lambertian part, between 0 and 1.
    specular : float
        k_s, weight of the specular part (a weight, not an energy: the Fresnel factor comes on
        top).
    roughness : float
        m of the Beckmann distribution, the root mean square slope.
    fresnel : ConstantFresnel or Dielectric
        Fresnel factor of the specular part.
    masking : "v_cavity", "smith" or "none"
        Geometric attenuation: min(1, G1(i), G1(o)) of V-cavities (Cook and Torrance 1981), or
        Smith's height-correlated 1 / (1 + Lambda_i + Lambda_o).
    """

    diffuse: Annotated[float, pydantic.Field(ge=0, le=1)] = 1.0
    specular: NonNegative = 0.0
    roughness: Annotated[float, pydantic.Field(ge=1e-4, le=10)] = 0.5
    fresnel: Annotated[ConstantFresnel | Dielectric, pydantic.Field(discriminator="kind")] = (
        ConstantFresnel()
    )
    masking: Literal["v_cavity", "smith", "none"] = "v_cavity"

    @pydantic.model_validator(mode="after")
    def _reflects(self) -> "Material":
        if self.diffuse == 0.0 and self.specular == 0.0:
            raise ValueError("diffuse and specular are both zero: the surface reflects nothing")
        return self


def diffuse(albedo: float = 1.0) -> Material:
    """Return a Lambertian material."""
    return Material(diffuse=albedo)


def pack_material(material: Material) -> Array:
    """Return (k_d, k_s, m, Fresnel kind, Fresnel parameter, masking) for the kernels."""
    if isinstance(material.fresnel, Dielectric):
        fresnel = (1.0, material.fresnel.refractive_index)
    else:
        fresnel = (0.0, material.fresnel.reflectance)
    return np.array(
        [
            material.diffuse,
            material.specular,
            material.roughness,
            *fresnel,
            _MASKINGS[material.masking],
        ]
    )
