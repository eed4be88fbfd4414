"""Optical crosstalk: what a flat cover glass in front of the sensor reflects straight back.

Each interface is a mirror of Fresnel reflectance F. A ray that leaves at the angle t and makes j
double passes through the glass returns at x = 2 h tan(t) + 2 j d tan(t'), n sin(t') = sin(t), and
the irradiance in the sensor's plane there is I_e sin(t) / (x dx/dt).
"""

import math
from typing import Annotated

import pydantic
from scipy.optimize import brentq

from simulator.errors import InvalidInputError
from simulator.optics.brdf import fresnel_dielectric
from simulator.optics.detectors import Detector
from simulator.optics.emitters import Emitter, Narrow, intensity
from simulator.optics.light import Light, Modulation, add, along_one_path
from simulator.optics.vectors import dot
from simulator.validated import Validated

__all__ = ["CoverGlass", "glass_crosstalk"]

_ORDERS = 8  # F^15 of glass is below 1e-20


class CoverGlass(Validated):
    """A flat plate parallel to the detector.

    Attributes
    ----------
    distance_m : float
        From the detector's plane to the near face [m].
    thickness_m : float
        [m].
    refractive_index : float
        1.5 gives 4 % a face at normal incidence.
    """

    distance_m: Annotated[float, pydantic.Field(gt=0)]
    thickness_m: Annotated[float, pydantic.Field(gt=0)] = 1e-3
    refractive_index: Annotated[float, pydantic.Field(ge=1)] = 1.5


def _inner_tangent(tangent: float, index: float) -> float:
    """Return tan(t') of the refracted ray."""
    return tangent / math.sqrt(index * index * (1.0 + tangent * tangent) - tangent * tangent)


def _order(
    glass: CoverGlass, emitter: Emitter, detector: Detector, passes: int, modulation: Modulation
) -> Light:
    baseline = tuple(d - e for d, e in zip(detector.position_m, emitter.position_m, strict=True))
    x = math.hypot(*baseline)
    near, inside = 2.0 * glass.distance_m, 2.0 * passes * glass.thickness_m
    index = glass.refractive_index

    def landing(tangent: float) -> float:
        return near * tangent + inside * _inner_tangent(tangent, index) - x

    tangent = brentq(landing, 0.0, x / near, xtol=1e-300, rtol=1e-15) if x > 0 else 0.0
    inner = _inner_tangent(tangent, index)
    secant2, inner_secant2 = 1.0 + tangent * tangent, 1.0 + inner * inner
    cosine, sine = 1.0 / math.sqrt(secant2), tangent / math.sqrt(secant2)
    # dx/dt, with cos(t') dt' n = cos(t) dt
    inner_cosine = 1.0 / math.sqrt(inner_secant2)
    slope = near * secant2 + inside * inner_secant2 * cosine / (index * inner_cosine)
    # sin(t)/x, finite on the axis
    spread = sine / x if x > 0 else 1.0 / (near + inside / index)
    reflectance = fresnel_dielectric(cosine, index)
    strength = reflectance
    if passes > 0:
        strength = (1.0 - reflectance) ** 2 * reflectance ** (2 * passes - 1)
    normal = detector.normal
    if x > 0:
        ray = tuple(cosine * n + sine * b / x for n, b in zip(normal, baseline, strict=True))
    else:
        ray = normal
    ahead = dot(emitter.aim, (ray[0], ray[1], ray[2]))
    pattern, table = emitter.pattern.pack()
    emitted = intensity(pattern, 0, table, ahead, math.sqrt(max(1.0 - ahead * ahead, 0.0)))
    flux = emitted * strength * spread / slope
    path = 0.5 * (near / cosine + inside * index / inner_cosine)
    return along_one_path(flux, path, modulation, "lit" if flux > 0 else "out_of_view")


def glass_crosstalk(
    glass: CoverGlass,
    emitter: Emitter | None = None,
    detector: Detector | None = None,
    modulation: Modulation | None = None,
) -> Light:
    """Return what a cover glass reflects into the detector, per Phi0 A_D.

    The loss that the glass causes to the light of the scene is part of a sensor's gain.

    Raises
    ------
    InvalidInputError
        If emitter and detector are not in one plane parallel to the glass, or for a narrow beam,
        whose mirror image is a point.
    """
    emitter, detector = emitter or Emitter(), detector or Detector()
    if isinstance(emitter.pattern, Narrow):
        raise InvalidInputError.at("/emitter/pattern", "a narrow beam has no irradiance")
    offset = (
        emitter.position_m[0] - detector.position_m[0],
        emitter.position_m[1] - detector.position_m[1],
        emitter.position_m[2] - detector.position_m[2],
    )
    if abs(dot(offset, detector.normal)) > 1e-9 * glass.distance_m:
        raise InvalidInputError.at(
            "/emitter/position_m", "must lie in the detector's plane, parallel to the cover glass"
        )
    modulation = modulation or Modulation()
    return add([_order(glass, emitter, detector, j, modulation) for j in range(_ORDERS)])
