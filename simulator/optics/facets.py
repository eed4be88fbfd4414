"""The thesis's own grid of facets, kept to reproduce and to judge its numbers.

It is a midpoint-like rule on an equal-angle polar grid whose facets count wholly or not at all, so
it converges as 1/N^2 on a shell or plane and as 1/N, unevenly, once the object has an edge
(docs/model.md, appendix-b, "Convergence"); `simulator.optics.quadrature` is
the one to use.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.brdf import reflect

__all__ = [
    "facet_plate",
    "facet_plate_sums",
    "facet_polar_grid",
    "facet_shell",
]

Array = NDArray[np.float64]

ELLIPSE, STRETCHED = 0, 1


def facet_polar_grid(n: int) -> tuple[Array, float]:
    """Return tan(theta) of the grid's rings and the solid-angle-like weight of one step.

    Parameters
    ----------
    n : int
        Rings, and facets a ring; theta = linspace(0, pi/2, n) with both ends.

    Returns
    -------
    theta : ndarray, shape (n,)
        Zenith angles [rad].
    step : float
        (pi / (2 (n - 1))) (2 pi / n) / 2 x 2 = d theta d phi [rad^2].

    Notes
    -----
    docs/model.md, appendix-b: with n = 100 the step in theta is pi/198.
    """
    return np.linspace(0.0, 0.5 * math.pi, n), 0.5 * math.pi / (n - 1) * (2 * math.pi / n)


@compiled
def facet_plate_sums(
    distance: float,
    tilt: float,
    half_width: float,
    half_height: float,
    outline: int,
    material: Array,
    wave_number: float,
    theta: Array,
    step: float,
) -> tuple[float, float, float, float]:
    """Sum the facets of a tilted plate at one distance (docs/model.md, appendix-b).

    Parameters
    ----------
    distance : float
        The plane cuts the z axis at z = distance [m].
    tilt : float
        The plane is turned about the y axis by this angle [rad].
    half_width, half_height : float
        [m]; infinite for a plane.
    outline : int
        0: the pulsed tables' hypot(dx, dz) <= W/2 and hypot(dy, dz) <= H/2; 1: the sine-wave
        tables' abs(dx) <= W/2 and abs(dy) <= H/2.
    material : ndarray, shape (6,)
        As packed by `simulator.optics.brdf.pack_material`.
    wave_number : float
        k = 4 pi f / c [rad/m].
    theta : ndarray
        Zenith angles of the rings [rad].
    step : float
        d theta d phi.

    Returns
    -------
    flux, moment, real, imaginary : float
        Sums of dPhi, dPhi r, dPhi cos(k r), dPhi sin(k r), per Phi0 A_D.
    """
    n = theta.size
    slope = math.tan(tilt)
    height = distance * math.cos(tilt)
    centre_x, centre_z = height * math.sin(tilt), height * math.cos(tilt)
    flux = moment = real = imaginary = 0.0
    for i in range(n):
        t = math.tan(theta[i])
        secant = 1.0 / math.cos(theta[i])
        area = distance * distance * t * secant * secant * step / math.cos(tilt)
        for j in range(n):
            phi = 2.0 * math.pi * j / n
            x, y = distance * t * math.cos(phi), distance * t * math.sin(phi)
            z = distance - x * slope
            if z < 0.0:
                continue
            dx, dy, dz = x - centre_x, y, z - centre_z
            if outline == ELLIPSE:
                inside = math.hypot(dx, dz) <= half_width and math.hypot(dy, dz) <= half_height
            else:
                inside = abs(dx) <= half_width and abs(dy) <= half_height
            if not inside:
                continue
            squared = x * x + y * y + z * z
            r = math.sqrt(squared)
            cosine = height / r
            tangent2 = max(1.0 / (cosine * cosine) - 1.0, 0.0)
            part = reflect(material, 0, cosine, cosine, cosine, tangent2, 1.0) * (z / r)
            part *= area / (2.0 * math.pi * squared * squared)
            flux += part
            moment += part * r
            real += part * math.cos(wave_number * r)
            imaginary += part * math.sin(wave_number * r)
    return flux, moment, real, imaginary


@compiled
def facet_plate(
    distances: Array,
    tilt: float,
    half_width: float,
    half_height: float,
    outline: int,
    material: Array,
    wave_number: float,
    theta: Array,
    step: float,
) -> Array:
    """Sum the facets at several distances; rows are those of `facet_plate_sums`."""
    sums = np.empty((distances.size, 4))
    for i in range(distances.size):
        sums[i] = facet_plate_sums(
            distances[i],
            tilt,
            half_width,
            half_height,
            outline,
            material,
            wave_number,
            theta,
            step,
        )
    return sums


def facet_shell(radius: float, n: int) -> tuple[float, float]:
    """Sum the facets of a diffuse hemispherical shell about the sensor (section 2.4.1).

    Parameters
    ----------
    radius : float
        [m].
    n : int
        Rings, and facets a ring.

    Returns
    -------
    flux, effective_distance : float
        Per Phi0 A_D [1/m^2], and [m].
    """
    theta, step = facet_polar_grid(n)
    kernel = np.cos(theta) * np.sin(theta) * step / (2 * math.pi * math.pi * radius * radius)
    flux = n * float(np.sum(kernel))
    return flux, n * float(np.sum(kernel * radius)) / flux
