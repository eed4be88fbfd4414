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
from simulator.optics.geometry import FLAT
from simulator.optics.rays import COMPONENTS, MOST_PIECES, UNKNOWN, along_ray, error_estimate
from simulator.optics.regions import ARC, LINE, ray, sectors

__all__ = ["GAUSS_KRONROD", "gauss_rule", "integrate"]

Array = NDArray[np.float64]

_OUTER = 400


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
def _sector_piece(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array,
    signal: Array,
    rules: tuple[Array, Array],
    marks: tuple[Array, Array, Array, Array, Array],
    lines: Array,
    circle: Array,
    reference: Array,
    panels: Array,
    tolerance: float,
    work: Array,
    breaks: Array,
    pieces: Array,
    row: int,
) -> None:
    """Integrate the piece of a sector that a row of ``pieces`` names, and complete the row."""
    outer, inner = rules
    low, high, which = pieces[row, 0], pieces[row, 1], int(pieces[row, 2])
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    kind = panels[which, 0]
    v0 = v1 = v2 = v3 = v4 = g0 = g1 = g2 = g3 = g4 = 0.0
    inner_error = 0.0
    for i in range(outer.shape[1]):
        s = middle + half * outer[0, i]
        reach = math.inf
        if kind == LINE:
            edge = int(panels[which, 3])
            h = lines[edge, 2]
            t = panels[which, 4] * math.sinh(s)
            reach = math.hypot(h, t)
            x = (h * lines[edge, 0] - t * lines[edge, 1]) / reach
            y = (h * lines[edge, 1] + t * lines[edge, 0]) / reach
            turn = h * math.hypot(panels[which, 4], t) / (reach * reach)
        else:
            angle, turn = s, 1.0
            if kind == ARC:
                angle = panels[which, 3] + panels[which, 4] * math.sin(s)
                turn = panels[which, 4] * math.cos(s)
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
        error = along_ray(
            chart, head, table, material, backdrop, signal, inner, marks, u, (x, y), near, far,
            tolerance, work, breaks,
        )  # fmt: skip
        k, g = turn * half * outer[1, i], turn * half * outer[2, i]
        inner_error += error * k
        v0 += work[0, 3] * k
        v1 += work[0, 4] * k
        v2 += work[0, 5] * k
        v3 += work[0, 6] * k
        v4 += work[0, 7] * k
        g0 += work[0, 3] * g
        g1 += work[0, 4] * g
        g2 += work[0, 5] * g
        g3 += work[0, 6] * g
        g4 += work[0, 7] * g
    worst = max(abs(v0 - g0), abs(v1 - g1), abs(v2 - g2), abs(v3 - g3), abs(v4 - g4))
    pieces[row, 3] = error_estimate(worst, v0) + inner_error
    pieces[row, 4], pieces[row, 5], pieces[row, 6] = v0, v1, v2
    pieces[row, 7], pieces[row, 8] = v3, v4


@compiled
def integrate(
    chart: Array,
    head: Array,
    table: Array,
    material: Array,
    backdrop: Array,
    signal: Array,
    rules: tuple[Array, Array],
    region: tuple[Array, Array],
    marks: tuple[Array, Array, Array, Array, Array],
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
        Rings, features, horizon planes, radii of a lobe, and cosines of an emitter's cones.
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
    spare = 40 + 2 * marks[4].size
    work = np.empty((MOST_PIECES + spare, 3 + COMPONENTS))
    breaks = np.empty(spare)
    for i in range(size):
        if panels[i, 0] == LINE:
            panels[i, 4] = math.hypot(lines[int(panels[i, 3]), 2], chart[11])
            pieces[i, 0] = math.asinh(panels[i, 1] / panels[i, 4])
            pieces[i, 1] = math.asinh(panels[i, 2] / panels[i, 4])
        else:
            pieces[i, 0], pieces[i, 1] = panels[i, 1], panels[i, 2]
        pieces[i, 2], pieces[i, 3] = i, UNKNOWN
    number = size
    rays = 0
    while True:
        total[:] = 0.0
        error, worst = 0.0, 0
        for i in range(number):
            if pieces[i, 3] == UNKNOWN:
                rays += rules[0].shape[1]
                _sector_piece(
                    chart, head, table, material, backdrop, signal, rules, marks, lines, circle,
                    reference, panels, 0.1 * tolerance, work, breaks, pieces, i,
                )  # fmt: skip
            for j in range(COMPONENTS):
                total[j] += pieces[i, 4 + j]
            error += pieces[i, 3]
            if pieces[i, 3] > pieces[worst, 3]:
                worst = i
        if error <= tolerance * total[0] or number >= limit:
            return total, error, rays
        middle = 0.5 * (pieces[worst, 0] + pieces[worst, 1])
        pieces[number, 0], pieces[number, 1] = middle, pieces[worst, 1]
        pieces[number, 2] = pieces[worst, 2]
        pieces[worst, 1] = middle
        pieces[worst, 3] = pieces[number, 3] = UNKNOWN
        number += 1
