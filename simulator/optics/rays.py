"""Adaptive integration of a surface's light along one ray of its chart."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.brdf import reflect
from simulator.optics.geometry import FLAT, SHELL, density

__all__ = ["COMPONENTS", "MOST_PIECES", "UNKNOWN", "along_ray", "error_estimate"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

# flux, flux r, flux min(r / r0, 1), flux cos(k r), flux sin(k r)
COMPONENTS = 5
MOST_PIECES = 60
# error of a piece that has not been integrated
UNKNOWN = -1.0


@compiled
def error_estimate(worst: float, size: float) -> float:
    """Return QUADPACK's estimate of the error from the disagreement of the two rules of a pair."""
    if worst == 0.0 or size == 0.0:
        return worst
    return float(size * min(1.0, (200.0 * worst / size) ** 1.5))


@compiled
def _ray_piece(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array,
    signal: Array,
    rule: Array,
    u: Vector,
    work: Array,
    row: int,
) -> None:
    """Integrate the piece of a ray that a row of ``work`` names, and complete the row."""
    scale = chart[11]
    low, high = work[row, 0], work[row, 1]
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    # Kronrod sums v and Gauss sums g, as scalars: an array for each piece would cost as much
    # as the integrand
    v0 = v1 = v2 = v3 = v4 = g0 = g1 = g2 = g3 = g4 = 0.0
    # flat under a uniform or Lambertian emitter at the detector: both directions are one, which
    # leaves a third of the cost
    plain = backdrop.size == 0 and chart[0] == FLAT and chart[31] > 0.0
    height = chart[18]
    diffuse = material[0] * (1.0 / math.pi)
    lobe = material[1] > 0.0
    see0 = chart[15] * head[9] + chart[16] * head[10] + chart[17] * head[11]
    see1 = u[0] * head[9] + u[1] * head[10] + u[2] * head[11]
    shine0 = chart[12] * head[3] + chart[13] * head[4] + chart[14] * head[5]
    shine1 = u[0] * head[3] + u[1] * head[4] + u[2] * head[5]
    for i in range(rule.shape[1]):
        t = math.tan(middle + half * rule[0, i])
        if plain:
            rho = scale * t
            see, shine = see0 + rho * see1, shine0 + rho * shine1
            if see <= 0.0 or shine <= 0.0:
                continue
            path = math.sqrt(height * height + rho * rho)
            inverse = 1.0 / path
            cosine = height * inverse
            if lobe:
                slope = rho / height
                f = reflect(material, 0, cosine, cosine, cosine, slope * slope, 1.0)
            else:
                f = diffuse * cosine * cosine
            inverse2 = inverse * inverse
            f *= head[14] * rho * see * inverse2 * inverse2 * inverse
            if head[12] == 1.0:
                f *= shine * inverse
        else:
            f, path = density(chart, head, table, material, backdrop, u, scale * t)
        if f == 0.0:
            continue
        f *= scale * (1.0 + t * t) * half
        k, g = f * rule[1, i], f * rule[2, i]
        late, far = min(path * signal[1], 1.0), path * signal[2]
        v0 += k
        g0 += g
        v1 += k * far
        g1 += g * far
        v2 += k * late
        g2 += g * late
        if signal[0] > 0.0:
            c, s = math.cos(signal[0] * path), math.sin(signal[0] * path)
            v3 += k * c
            g3 += g * c
            v4 += k * s
            g4 += g * s
    worst = max(abs(v0 - g0), abs(v1 - g1), abs(v2 - g2), abs(v3 - g3), abs(v4 - g4))
    work[row, 2] = error_estimate(worst, v0)
    work[row, 3], work[row, 4], work[row, 5] = v0, v1, v2
    work[row, 6], work[row, 7] = v3, v4


@compiled
def _insert(breaks: Array, count: int, place: float, near: float, far: float) -> int:
    """Insert a place into the sorted breaks if it lies inside the ray."""
    if not near < place < far:
        return count
    i = count
    while i > 0 and breaks[i - 1] > place:
        breaks[i] = breaks[i - 1]
        i -= 1
    breaks[i] = place
    return count + 1


@compiled
def _horizon_breaks(
    chart: Array, planes: Array, u: Vector, breaks: Array, count: int, near: float, far: float
) -> int:
    """Insert the places where a ray of a sphere or shell crosses a horizon."""
    for i in range(planes.shape[0]):
        alpha = planes[i, 0] * chart[7] + planes[i, 1] * chart[8] + planes[i, 2] * chart[9]
        beta = planes[i, 0] * u[0] + planes[i, 1] * u[1] + planes[i, 2] * u[2]
        size = math.hypot(alpha, beta)
        if size <= abs(planes[i, 3]):
            continue
        centre, spread = math.atan2(beta, alpha), math.acos(planes[i, 3] / size)
        for j in range(2):
            psi = centre + (2 * j - 1) * spread
            psi -= 2.0 * math.pi * math.floor(psi / (2.0 * math.pi))
            if psi < math.pi:
                place = psi if chart[0] == SHELL else 2.0 * math.sin(0.5 * psi)
                count = _insert(breaks, count, place, near, far)
    return count


@compiled
def _cone_breaks(
    chart: Array,
    head: Array,
    cones: Array,
    u: Vector,
    breaks: Array,
    count: int,
    near: float,
    far: float,
) -> int:
    """Insert the places where a ray of a flat chart crosses a cone about the emitter's aim."""
    p0 = chart[12] * head[3] + chart[13] * head[4] + chart[14] * head[5]
    p1 = u[0] * head[3] + u[1] * head[4] + u[2] * head[5]
    q0 = chart[12] * chart[12] + chart[13] * chart[13] + chart[14] * chart[14]
    q1 = chart[12] * u[0] + chart[13] * u[1] + chart[14] * u[2]
    for i in range(cones.size):
        c2 = cones[i] * cones[i]
        a, b, c = p1 * p1 - c2, p0 * p1 - c2 * q1, p0 * p0 - c2 * q0
        square = b * b - a * c
        if square <= 0.0:
            continue
        # both roots without cancellation; the shadow cone behind the emitter does no harm
        t = -b - math.copysign(math.sqrt(square), b)
        if a != 0.0:
            count = _insert(breaks, count, t / a, near, far)
        if t != 0.0:
            count = _insert(breaks, count, c / t, near, far)
    return count


@compiled
def along_ray(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array,
    signal: Array,
    rule: Array,
    marks: tuple[Array, Array, Array, Array, Array],
    u: Vector,
    direction: tuple[float, float],
    near: float,
    far: float,
    tolerance: float,
    work: Array,
    breaks: Array,
) -> float:
    """Integrate along a ray into the first row of ``work`` and return the error."""
    rings, features, planes, lobes, cones = marks
    count = 0
    for i in range(rings.size):
        count = _insert(breaks, count, rings[i], near, far)
    for i in range(lobes.size):
        count = _insert(breaks, count, math.hypot(near, lobes[i]), near, far)
    for i in range(features.shape[0]):
        closest = features[i, 0] * direction[0] + features[i, 1] * direction[1]
        count = _insert(breaks, count, closest, near, far)
        if features[i, 2] > 0.0:
            for j in (-3.0, -1.0, 1.0, 3.0):
                count = _insert(breaks, count, closest + j * features[i, 2], near, far)
    if cones.size > 0 and chart[0] == FLAT:
        count = _cone_breaks(chart, head, cones, u, breaks, count, near, far)
    if planes.shape[0] > 0:
        count = _horizon_breaks(chart, planes, u, breaks, count, near, far)
    if chart[32] > 0.0 and lobes.size > 0 and chart[0] == FLAT:
        # a pure lobe is below 1e-27 of itself past the last mark
        end = math.hypot(near, lobes[lobes.size - 1])
        far = min(far, end)
        while count > 0 and breaks[count - 1] >= far:
            count -= 1
    scale = chart[11]
    last = math.atan(near / scale)
    for i in range(count + 1):
        angle = math.atan((far if i == count else breaks[i]) / scale)
        work[i + 1, 0], work[i + 1, 1], work[i + 1, 2] = last, angle, UNKNOWN
        last = angle
    number = count + 1
    most = MOST_PIECES + count
    while True:
        for j in range(2, 3 + COMPONENTS):
            work[0, j] = 0.0
        worst = 1
        for i in range(1, number + 1):
            # one place that calls the kernel: compilers copy it to each
            if work[i, 2] == UNKNOWN:
                _ray_piece(chart, head, table, material, backdrop, signal, rule, u, work, i)
            for j in range(2, 3 + COMPONENTS):
                work[0, j] += work[i, j]
            if work[i, 2] > work[worst, 2]:
                worst = i
        if work[0, 2] <= tolerance * work[0, 3] or number >= most:
            return float(work[0, 2])
        middle = 0.5 * (work[worst, 0] + work[worst, 1])
        number += 1
        work[number, 0], work[number, 1] = middle, work[worst, 1]
        work[worst, 1] = middle
        work[worst, 2] = work[number, 2] = UNKNOWN
