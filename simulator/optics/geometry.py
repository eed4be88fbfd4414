"""The layout of packed arrays that the optical kernels share, and the light path at a point.

A kernel knows a surface as a chart: a base point and three axes such that a point lies at
``radial`` from the base along a ray ``u`` of the chart's plane.

========  ==========================  =================================  ==================
chart     base                        point P                            area element
========  ==========================  =================================  ==================
flat      mirror point of the plane   B + rho u                          rho d rho d phi
sphere    point nearest the sensor    B + R (u sin psi - n (1-cos psi)), R^2 x dx d phi
                                      x = 2 sin(psi / 2)
shell     the detector                B + s (n cos theta + u sin theta)  solid angle
========  ==========================  =================================  ==================
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.brdf import reflect
from simulator.optics.emitters import intensity

__all__ = ["FLAT", "SHELL", "SPHERE", "density", "hidden_backdrop", "light_path"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

FLAT, SPHERE, SHELL = 0.0, 1.0, 2.0

# head: emitter position 0:3, aim 3:6, detector position 6:9, normal 9:12, pattern 12:16
# chart: kind 0, axes u 1:4, v 4:7, n 7:10, radius 10, scale 11, base - emitter 12:15,
#        base - detector 15:18, heights of emitter and detector 18, 19, shell 20:33, of a flat chart
#        32 is 1 if it has nothing but a lobe about its base, and 31 if emitter and detector are at
#        one point and the emitter is uniform or Lambertian
# backdrop: detector - centre 0:3, radius 3, centre - emitter 4:7, material 7:13; empty for none, so
# that one machine code does for both


@compiled
def light_path(
    head: Array,
    table: Array,
    material: Array,
    at: int,
    to_emitter: Vector,
    to_detector: Vector,
    normal: Vector,
    height_i: float,
    height_o: float,
) -> tuple[float, float, float]:
    """Return f_r cos_i cos_o I_e cos_d / r_i^2, r_i, r_o (docs/model.md, kernel, without 1/r_o^2).

    Parameters
    ----------
    head, table, material : ndarray
        Packed emitter and detector, table of the emitter, reflectance.
    at : int
        Where in its array the reflectance begins.
    to_emitter, to_detector : (float, float, float)
        The point seen from the emitter and from the detector [m] (P - E and P - D).
    normal : (float, float, float)
        Unit normal of the lit face.
    height_i, height_o : float
        Distance of emitter and detector from the tangent plane [m]; the point is dark where one of
        them is not positive.
    """
    ex, ey, ez = to_emitter
    dx, dy, dz = to_detector
    ri = math.sqrt(ex * ex + ey * ey + ez * ez)
    inverse_i = 1.0 / ri
    ro, inverse_o = ri, inverse_i
    if ex != dx or ey != dy or ez != dz:
        ro = math.sqrt(dx * dx + dy * dy + dz * dz)
        inverse_o = 1.0 / ro
    along = dx * head[9] + dy * head[10] + dz * head[11]
    ahead = ex * head[3] + ey * head[4] + ez * head[5]
    if height_i <= 0.0 or height_o <= 0.0 or along <= 0.0 or ahead <= 0.0:
        return 0.0, ri, ro
    sine = 0.0
    if head[12] > 1.0:  # patterns that need the angle itself
        sx = ey * head[5] - ez * head[4]
        sy = ez * head[3] - ex * head[5]
        sz = ex * head[4] - ey * head[3]
        sine = math.sqrt(sx * sx + sy * sy + sz * sz) * inverse_i
    # the plainest pattern is not worth a call
    plain = head[12] == 0.0
    emitted = head[14] if plain else intensity(head, 12, table, ahead * inverse_i, sine)
    if emitted == 0.0:
        return 0.0, ri, ro
    cos_i, cos_o = min(height_i * inverse_i, 1.0), min(height_o * inverse_o, 1.0)
    if material[at + 1] == 0.0:
        reflected = material[at] * cos_i * cos_o * (1.0 / math.pi)
    else:
        hx = -ex * inverse_i - dx * inverse_o
        hy = -ey * inverse_i - dy * inverse_o
        hz = -ez * inverse_i - dz * inverse_o
        length = math.sqrt(hx * hx + hy * hy + hz * hz)
        upward = cos_i + cos_o
        tx = normal[1] * hz - normal[2] * hy
        ty = normal[2] * hx - normal[0] * hz
        tz = normal[0] * hy - normal[1] * hx
        tangent2 = (tx * tx + ty * ty + tz * tz) / (upward * upward)
        reflected = reflect(
            material, at, cos_i, cos_o, min(upward / length, 1.0), tangent2, min(0.5 * length, 1.0)
        )
    return reflected * emitted * (along * inverse_o) * (inverse_i * inverse_i), ri, ro


@compiled
def hidden_backdrop(
    head: Array, table: Array, backdrop: Array, ox: float, oy: float, oz: float
) -> tuple[float, float]:
    """Return what a backdrop shell sends to the detector from a direction, and its mean path.

    Parameters
    ----------
    head, table : ndarray
        Packed emitter and detector.
    backdrop : ndarray, shape (13,)
        The shell.
    ox, oy, oz : float
        Unit direction from the detector.

    Returns
    -------
    radiance : float
        Flux per Phi0 A_D and per solid angle [1/(m^2 sr)].
    path : float
        (r_i + r_o) / 2 [m].
    """
    radius = backdrop[3]
    along = backdrop[0] * ox + backdrop[1] * oy + backdrop[2] * oz
    offset = math.sqrt(
        backdrop[0] * backdrop[0] + backdrop[1] * backdrop[1] + backdrop[2] * backdrop[2]
    )
    s = -along + math.sqrt(along * along + (radius - offset) * (radius + offset))
    dx, dy, dz = s * ox, s * oy, s * oz
    nx = -(backdrop[0] + dx) / radius
    ny = -(backdrop[1] + dy) / radius
    nz = -(backdrop[2] + dz) / radius
    ex = backdrop[0] + dx + backdrop[4]
    ey = backdrop[1] + dy + backdrop[5]
    ez = backdrop[2] + dz + backdrop[6]
    height_i = -(ex * nx + ey * ny + ez * nz)
    height_o = -(dx * nx + dy * ny + dz * nz)
    value, ri, ro = light_path(
        head,
        table,
        backdrop,
        7,
        (ex, ey, ez),
        (dx, dy, dz),
        (nx, ny, nz),
        height_i,
        height_o,
    )
    # cos_o dA / r_o^2 is the solid angle
    return value * s / height_o, 0.5 * (ri + ro)


@compiled
def density(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array,
    u: Vector,
    radial: float,
) -> tuple[float, float]:
    """Return dPhi / (d radial d phi) per Phi0 A_D, and the mean path (r_i + r_o) / 2 [m].

    With a backdrop: what the surface hides of it, instead of what the surface sends.
    """
    kind = chart[0]
    nx, ny, nz = chart[7], chart[8], chart[9]
    if kind == SHELL:
        c, s = math.cos(radial), math.sin(radial)
        ox, oy, oz = nx * c + u[0] * s, ny * c + u[1] * s, nz * c + u[2] * s
        value, path = hidden_backdrop(head, table, chart[20:33], ox, oy, oz)
        return value * s, path
    if kind == FLAT:
        shift, sink, jacobian = radial, 0.0, radial
        height_i, height_o = chart[18], chart[19]
    else:
        radius = chart[10]
        half2 = 0.25 * radial * radial
        sine, one_cosine = radial * math.sqrt(max(1.0 - half2, 0.0)), 2.0 * half2
        shift, sink, jacobian = radius * sine, -radius * one_cosine, radius * radius * radial
    ex = chart[12] + shift * u[0] + sink * nx
    ey = chart[13] + shift * u[1] + sink * ny
    ez = chart[14] + shift * u[2] + sink * nz
    dx = chart[15] + shift * u[0] + sink * nx
    dy = chart[16] + shift * u[1] + sink * ny
    dz = chart[17] + shift * u[2] + sink * nz
    if kind == SPHERE:
        cosine = 1.0 - one_cosine
        nx, ny, nz = nx * cosine + u[0] * sine, ny * cosine + u[1] * sine, nz * cosine + u[2] * sine
        height_i = -(ex * nx + ey * ny + ez * nz)
        height_o = -(dx * nx + dy * ny + dz * nz)
    if backdrop.size > 0:
        if height_o <= 0.0:
            return 0.0, 0.0
        ro = math.sqrt(dx * dx + dy * dy + dz * dz)
        hidden, path = hidden_backdrop(head, table, backdrop, dx / ro, dy / ro, dz / ro)
        return hidden * jacobian * height_o / (ro * ro * ro), path
    value, ri, ro = light_path(
        head, table, material, 0, (ex, ey, ez), (dx, dy, dz), (nx, ny, nz), height_i, height_o
    )
    return value * jacobian / (ro * ro), 0.5 * (ri + ro)
