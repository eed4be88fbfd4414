"""Nested Gauss-Kronrod quadrature over the charts of surfaces.

The outer variable runs along the far end of a sector, the inner one along a ray. Every kink and
sharp place that is known beforehand (rings, features, horizons) ends a piece, so the rule converges
geometrically on each piece; pieces whose embedded 7-point rule disagrees are halved. With one
Gauss rule in place of the pair nothing is halved, which is the fixed rule of the convergence study.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.geometry import FLAT, SHELL, SPHERE, density
from simulator.optics.regions import ARC, LINE, ray, sectors

__all__ = ["COMPONENTS", "GAUSS_KRONROD", "gauss_rule", "integrate"]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

# flux, flux r, flux min(r / r0, 1), flux cos(k r), flux sin(k r)
COMPONENTS = 5
_INNER, _OUTER = 60, 400


def _gauss_kronrod() -> Array:
    """Return nodes, Kronrod weights and embedded Gauss weights of the 7-15 pair on [-1, 1]."""
    nodes = [
        0.991455371120812639206854697526329,
        0.949107912342758524526189684047851,
        0.864864423359769072789712788640926,
        0.741531185599394439863864773280788,
        0.586087235467691130294144691693013,
        0.405845151377397166906606412076961,
        0.207784955007898467600689403773245,
        0.0,
    ]
    kronrod = [
        0.022935322010529224963732008058970,
        0.063092092629978553290700663189204,
        0.104790010322250183839876322541518,
        0.140653259715525918745189590510238,
        0.169004726639267902826583426598550,
        0.190350578064785409913256402421014,
        0.204432940075298892414161999234649,
        0.209482141084727828012999174891714,
    ]
    gauss = [
        0.0,
        0.129484966168869693270611432679082,
        0.0,
        0.279705391489276667901467771423780,
        0.0,
        0.381830050505118944950369775488975,
        0.0,
        0.417959183673469387755102040816327,
    ]
    rows = [(-x, k, g) for x, k, g in zip(nodes[:-1], kronrod[:-1], gauss[:-1], strict=True)]
    rows += [(x, k, g) for x, k, g in zip(nodes[::-1], kronrod[::-1], gauss[::-1], strict=True)]
    return np.ascontiguousarray(np.array(rows).T)


GAUSS_KRONROD = _gauss_kronrod()


def gauss_rule(order: int) -> Array:
    """Return an n-point Gauss-Legendre rule in the shape of `GAUSS_KRONROD`, error always 0."""
    x, w = np.polynomial.legendre.leggauss(order)
    return np.ascontiguousarray(np.vstack([x, w, w]))


@compiled
def _error(value: Array, other: Array) -> float:
    """Return QUADPACK's estimate of the error from the two rules of a pair."""
    worst = 0.0
    for i in range(COMPONENTS):
        worst = max(worst, abs(value[i] - other[i]))
    size = abs(value[0])
    if worst == 0.0 or size == 0.0:
        return worst
    return size * min(1.0, (200.0 * worst / size) ** 1.5)


@compiled
def _ray_piece(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array | None,
    signal: Array,
    rule: Array,
    u: Vector,
    low: float,
    high: float,
    value: Array,
) -> float:
    """Integrate one piece of a ray into ``value`` and return its error."""
    scale = chart[11]
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    other = np.zeros(COMPONENTS)
    value[:] = 0.0
    for i in range(rule.shape[1]):
        t = math.tan(middle + half * rule[0, i])
        f, path = density(chart, head, table, material, backdrop, u, scale * t)
        if f == 0.0:
            continue
        f *= scale * (1.0 + t * t) * half
        k, g = f * rule[1, i], f * rule[2, i]
        late = min(path * signal[1], 1.0)
        value[0] += k
        other[0] += g
        value[1] += k * path * signal[2]
        other[1] += g * path * signal[2]
        value[2] += k * late
        other[2] += g * late
        if signal[0] > 0.0:
            c, s = math.cos(signal[0] * path), math.sin(signal[0] * path)
            value[3] += k * c
            other[3] += g * c
            value[4] += k * s
            other[4] += g * s
    return _error(value, other)


@compiled
def _plane_breaks(chart: Array, planes: Array, u: Vector, breaks: Array, count: int) -> int:
    """Add the places where a ray of a sphere or shell crosses a horizon."""
    for i in range(planes.shape[0]):
        alpha = planes[i, 0] * chart[7] + planes[i, 1] * chart[8] + planes[i, 2] * chart[9]
        beta = planes[i, 0] * u[0] + planes[i, 1] * u[1] + planes[i, 2] * u[2]
        size = math.hypot(alpha, beta)
        if size <= abs(planes[i, 3]):
            continue
        centre, spread = math.atan2(beta, alpha), math.acos(planes[i, 3] / size)
        for sign in (-1.0, 1.0):
            psi = centre + sign * spread
            psi -= 2.0 * math.pi * math.floor(psi / (2.0 * math.pi))
            if 0.0 < psi < math.pi:
                breaks[count] = psi if chart[0] == SHELL else 2.0 * math.sin(0.5 * psi)
                count += 1
    return count


@compiled
def _along_ray(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array | None,
    signal: Array,
    rule: Array,
    marks: tuple[Array, Array, Array, Array],
    u: Vector,
    direction: tuple[float, float],
    near: float,
    far: float,
    tolerance: float,
    work: Array,
    value: Array,
) -> float:
    """Integrate along a ray into ``value`` and return the error."""
    rings, features, planes, lobes = marks
    breaks = np.empty(2 + rings.size + 3 * features.shape[0] + 2 * planes.shape[0] + lobes.size)
    breaks[0] = near
    count = 1
    for i in range(rings.size):
        breaks[count] = rings[i]
        count += 1
    for i in range(lobes.size):
        breaks[count] = math.hypot(near, lobes[i])
        count += 1
    for i in range(features.shape[0]):
        closest = features[i, 0] * direction[0] + features[i, 1] * direction[1]
        breaks[count] = closest
        count += 1
        if features[i, 2] > 0.0:
            breaks[count], breaks[count + 1] = closest - features[i, 2], closest + features[i, 2]
            count += 2
    if chart[0] != FLAT:
        count = _plane_breaks(chart, planes, u, breaks, count)
    ends = np.sort(breaks[:count])
    number = 0
    scale = chart[11]
    last = math.atan(near / scale)
    for i in range(count + 1):
        end = far if i == count else ends[i]
        if end <= near or end > far or (i < count and end == far):
            continue
        angle = math.atan(end / scale)
        work[number, 0], work[number, 1] = last, angle
        number += 1
        last = angle
    value[:] = 0.0
    total_error = 0.0
    for i in range(number):
        work[i, 2] = _ray_piece(
            chart, head, table, material, backdrop, signal, rule, u, work[i, 0], work[i, 1],
            work[i, 3:],
        )  # fmt: skip
        value += work[i, 3:]
        total_error += work[i, 2]
    while total_error > tolerance * value[0] and number < _INNER:
        worst = 0
        for i in range(1, number):
            if work[i, 2] > work[worst, 2]:
                worst = i
        middle = 0.5 * (work[worst, 0] + work[worst, 1])
        work[number, 0], work[number, 1] = middle, work[worst, 1]
        work[worst, 1] = middle
        for i in (worst, number):
            work[i, 2] = _ray_piece(
                chart, head, table, material, backdrop, signal, rule, u, work[i, 0], work[i, 1],
                work[i, 3:],
            )  # fmt: skip
        number += 1
        value[:] = 0.0
        total_error = 0.0
        for i in range(number):
            value += work[i, 3:]
            total_error += work[i, 2]
    return total_error


@compiled
def _sector_piece(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array | None,
    signal: Array,
    rules: tuple[Array, Array],
    marks: tuple[Array, Array, Array, Array],
    lines: Array,
    circle: Array,
    reference: Array,
    panel: Array,
    low: float,
    high: float,
    tolerance: float,
    work: Array,
    value: Array,
) -> float:
    """Integrate one piece of a sector into ``value`` and return its error."""
    outer, inner = rules
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    other, part = np.zeros(COMPONENTS), np.zeros(COMPONENTS)
    value[:] = 0.0
    inner_error = 0.0
    for i in range(outer.shape[1]):
        s = middle + half * outer[0, i]
        reach = math.inf
        if panel[0] == LINE:
            row = int(panel[3])
            h = lines[row, 2]
            t = panel[4] * math.sinh(s)
            reach = math.hypot(h, t)
            x = (h * lines[row, 0] - t * lines[row, 1]) / reach
            y = (h * lines[row, 1] + t * lines[row, 0]) / reach
            turn = h * panel[4] * math.cosh(s) / (reach * reach)
        else:
            angle, turn = s, 1.0
            if panel[0] == ARC:
                angle, turn = panel[3] + panel[4] * math.sin(s), panel[4] * math.cos(s)
            c, sn = math.cos(angle), math.sin(angle)
            x = reference[0] * c - reference[1] * sn
            y = reference[1] * c + reference[0] * sn
        near, far, _ = ray(lines, circle, x, y)
        far = min(far, reach)
        if not near < far:
            continue
        u = (
            x * chart[1] + y * chart[4],
            x * chart[2] + y * chart[5],
            x * chart[3] + y * chart[6],
        )
        error = _along_ray(
            chart, head, table, material, backdrop, signal, inner, marks, u, (x, y), near, far,
            tolerance, work, part,
        )  # fmt: skip
        scale = turn * half
        inner_error += error * scale * outer[1, i]
        for j in range(COMPONENTS):
            value[j] += part[j] * scale * outer[1, i]
            other[j] += part[j] * scale * outer[2, i]
    return _error(value, other) + inner_error


@compiled
def integrate(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array | None,
    signal: Array,
    rules: tuple[Array, Array],
    region: tuple[Array, Array],
    marks: tuple[Array, Array, Array, Array],
    tolerance: float,
) -> tuple[Array, float, int]:
    """Integrate the light of one surface.

    Parameters
    ----------
    chart, head, table, material, backdrop : ndarray
        See `simulator.optics.geometry`.
    signal : ndarray, shape (3,)
        k of a sine wave or 0, 1/r0 of a pulse or 0, and the inverse of a typical range.
    rules : (ndarray, ndarray)
        Outer and inner rule.
    region : (ndarray, ndarray)
        Half-planes and circle of the chart's plane.
    marks : tuple of ndarray
        Rings, features, horizon planes, and radii of a lobe.
    tolerance : float
        Relative.

    Returns
    -------
    value : ndarray, shape (5,)
        The components.
    error : float
        Estimate of the absolute error of the flux.
    evaluations : int
        Number of rays.
    """
    lines, circle = region
    total = np.zeros(COMPONENTS)
    panels, reference, nearest = sectors(lines, circle, marks[0], marks[1])
    if panels.shape[0] == 0:
        return total, 0.0, 0
    if chart[0] == FLAT:
        chart[11] = math.hypot(chart[11], nearest)
    size = panels.shape[0]
    limit = max(_OUTER, 2 * size)
    pieces = np.empty((limit, 4 + COMPONENTS))
    work = np.empty((_INNER + 40, 3 + COMPONENTS))
    for i in range(size):
        if panels[i, 0] == LINE:
            panels[i, 4] = math.hypot(lines[int(panels[i, 3]), 2], chart[11])
            pieces[i, 0] = math.asinh(panels[i, 1] / panels[i, 4])
            pieces[i, 1] = math.asinh(panels[i, 2] / panels[i, 4])
        else:
            pieces[i, 0], pieces[i, 1] = panels[i, 1], panels[i, 2]
        pieces[i, 2] = i
        pieces[i, 3] = _sector_piece(
            chart, head, table, material, backdrop, signal, rules, marks, lines, circle, reference,
            panels[i], pieces[i, 0], pieces[i, 1], 0.1 * tolerance, work, pieces[i, 4:],
        )  # fmt: skip
    number = size
    rays = size * rules[0].shape[1]
    while True:
        total[:] = 0.0
        error, worst = 0.0, 0
        for i in range(number):
            total += pieces[i, 4:]
            error += pieces[i, 3]
            if pieces[i, 3] > pieces[worst, 3]:
                worst = i
        if error <= tolerance * total[0] or number >= limit:
            return total, error, rays
        middle = 0.5 * (pieces[worst, 0] + pieces[worst, 1])
        pieces[number, 0], pieces[number, 1] = middle, pieces[worst, 1]
        pieces[number, 2] = pieces[worst, 2]
        pieces[worst, 1] = middle
        for i in (worst, number):
            pieces[i, 3] = _sector_piece(
                chart, head, table, material, backdrop, signal, rules, marks, lines, circle,
                reference, panels[int(pieces[i, 2])], pieces[i, 0], pieces[i, 1], 0.1 * tolerance,
                work, pieces[i, 4:],
            )  # fmt: skip
        number += 1
        rays += 2 * rules[0].shape[1]
