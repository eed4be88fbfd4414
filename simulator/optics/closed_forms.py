"""Closed forms: shell, plane and disk on the axis under axisymmetric emitters.

Tables 3.1 and 3.2 and equations 2.50, 2.57, 3.4 to 3.15, all as in docs/model.md. The object
is diffuse with albedo 1 (f_r = 1/pi); fluxes are per Phi0 A_D [1/m^2].

With t the angle from the axis the kernel of a plane is I_e(t) cos^4(t) sin(t), so that everything
follows from the moments int I_e cos^n sin.
"""

import math
from dataclasses import dataclass

import numpy as np

from simulator.optics.emitters import CosinePower, Linear, Narrow, Uniform

__all__ = [
    "ClosedPattern",
    "Quartic",
    "disk_crossover",
    "disk_distance",
    "disk_far_flux",
    "disk_flux",
    "disk_shadow",
    "plane_distance",
    "plane_flux",
    "quartic",
    "shell_flux",
]

ClosedPattern = Uniform | CosinePower | Linear | Narrow

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def _linear_moment(n: int, angle: float) -> float:
    """Return int (pi/2 - t) cos^n(t) sin(t) dt from 0 to an angle, n = 3 or 4."""
    if angle < 0.05:  # the closed form cancels like angle^-1; twelve Gauss points are exact here
        t = 0.5 * angle * (_NODES + 1.0)
        values = (0.5 * math.pi - t) * np.cos(t) ** n * np.sin(t)
        return float(0.5 * angle * np.sum(_WEIGHTS * values))
    s, c = math.sin(angle), math.cos(angle)
    if n == 3:
        rest = 3 * angle / 8 + 3 * s * c / 8 + s * c**3 / 4
    else:
        rest = s - 2 * s**3 / 3 + s**5 / 5
    return (0.5 * math.pi - (0.5 * math.pi - angle) * c ** (n + 1) - rest) / (n + 1)


def _edge(z: float, radius: float, power: float) -> float:
    """Return 1 - C^power, C = z / sqrt(z^2 + a^2)."""
    if math.isinf(radius):
        return 1.0
    return -math.expm1(-0.5 * power * math.log1p((radius / z) ** 2))


def _exponent(pattern: ClosedPattern) -> float:
    return pattern.exponent if isinstance(pattern, CosinePower) else 0.0


def shell_flux(radius_m: float, pattern: ClosedPattern | None = None) -> float:
    """Return the flux of a hemispherical shell about the sensor (2.50 for other emitters)."""
    pattern = pattern or Uniform()
    if isinstance(pattern, Narrow):
        share = 1.0
    elif isinstance(pattern, Linear):
        share = math.pi / (4 * (math.pi - 2))
    else:
        share = (_exponent(pattern) + 1) / (_exponent(pattern) + 2)
    return share / (math.pi * radius_m * radius_m)


def disk_flux(z: float, radius_m: float, pattern: ClosedPattern | None = None) -> float:
    """Return the flux of a disk on the axis (3.7, 3.12, Table 3.2).

    Parameters
    ----------
    z : float
        Distance of its plane [m].
    radius_m : float
        [m]; inf for an infinite plane.
    pattern : optional
        Emitter, default uniform.
    """
    pattern = pattern or Uniform()
    if isinstance(pattern, Narrow):
        return 1.0 / (math.pi * z * z)
    if isinstance(pattern, Linear):
        moment = _linear_moment(4, math.atan2(radius_m, z))
        return 2.0 * moment / (math.pi * (math.pi - 2) * z * z)
    n = _exponent(pattern)
    return (n + 1) / (math.pi * z * z * (n + 5)) * _edge(z, radius_m, n + 5)


def disk_distance(z: float, radius_m: float, pattern: ClosedPattern | None = None) -> float:
    """Return the effective distance r_e of a disk on the axis [m] (3.6, Table 3.1)."""
    pattern = pattern or Uniform()
    if isinstance(pattern, Narrow):
        return z
    if isinstance(pattern, Linear):
        angle = math.atan2(radius_m, z)
        return z * _linear_moment(3, angle) / _linear_moment(4, angle)
    n = _exponent(pattern)
    return (n + 5) / (n + 4) * z * _edge(z, radius_m, n + 4) / _edge(z, radius_m, n + 5)


def plane_flux(z: float, pattern: ClosedPattern | None = None) -> float:
    """Return the flux of an infinite plane, the limit z << a of Table 3.2 (2.57)."""
    return disk_flux(z, math.inf, pattern)


def plane_distance(z: float, pattern: ClosedPattern | None = None) -> float:
    """Return the effective distance of an infinite plane, the limit z << a of Table 3.1."""
    return disk_distance(z, math.inf, pattern)


def disk_far_flux(z: float, radius_m: float, pattern: ClosedPattern | None = None) -> float:
    """Return the fourth-law limit z >> a of Table 3.2; a narrow beam has none."""
    pattern = pattern or Uniform()
    if isinstance(pattern, Narrow):
        raise ValueError("a narrow beam never falls off the edge of a disk")
    if isinstance(pattern, Linear):
        share = 1.0 / (2 * (math.pi - 2))
    else:
        share = (_exponent(pattern) + 1) / (2 * math.pi)
    return share * radius_m**2 / z**4


def disk_crossover(pattern: ClosedPattern | None = None) -> float:
    """Return eta, the z/a at which the two limits of Table 3.2 meet."""
    pattern = pattern or Uniform()
    if isinstance(pattern, Narrow):
        raise ValueError("a narrow beam never falls off the edge of a disk")
    return math.sqrt(disk_far_flux(1.0, 1.0, pattern) / plane_flux(1.0, pattern))


def disk_shadow(z: float, radius_m: float) -> float:
    """Return S of a disk before a diffuse shell under a uniform emitter, z^2/(z^2 + a^2)."""
    return 1.0 / (1.0 + (radius_m / z) ** 2)


@dataclass(frozen=True, slots=True)
class Quartic:
    """An approximation strength a^2 / (r^2 (r^2 - linear a r + area a^2)).

    Attributes
    ----------
    strength, linear, area : float
        Coefficients, all per powers of the disk's radius a.
    """

    strength: float
    linear: float
    area: float

    def flux(self, r: float, radius_m: float) -> float:
        """Return the flux per Phi0 A_D [1/m^2] at r [m]."""
        a = radius_m
        return self.strength * a * a / (r * r * (r * r - self.linear * a * r + self.area * a * a))


# docs/model.md, 3.9, 3.10 and 3.15, in z and in r_e
_QUARTICS: dict[tuple[str, str], Quartic] = {
    ("uniform", "z"): Quartic(1 / (2 * math.pi), 0.35, 2.5),
    ("uniform", "r_e"): Quartic(1 / (2 * math.pi), 0.405, 1.6),
    ("lambertian", "z"): Quartic(1 / math.pi, 0.425, 3.0),
    ("lambertian", "r_e"): Quartic(1 / math.pi, 0.475, 2.085),
}


def quartic(emitter: str, variable: str) -> Quartic:
    """Return the thesis's quartic approximation of a disk (3.9, 3.10, 3.15 as corrected).

    Parameters
    ----------
    emitter : "uniform" or "lambertian"
        Emitter.
    variable : "z" or "r_e"
        Whether it is in the distance of the plane or in the effective distance.

    Raises
    ------
    KeyError
        For another name.
    """
    return _QUARTICS[emitter, variable]
