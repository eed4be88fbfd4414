"""From a surface and a sensor head to a chart: where to integrate, and what is sharp where."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.geometry import FLAT
from simulator.optics.marks import (
    DISK,
    EDGE_ON,
    LIT,
    OPPOSITE,
    OUT_OF_VIEW,
    RECTANGLE,
    ROUND,
    Chart,
    arms,
    cone_cosines,
    dot3,
    lobe_radii,
    spread_angle,
)
from simulator.optics.round_charts import sphere_chart

__all__ = ["build_chart"]

Array = NDArray[np.float64]

# an infinite plane ends where cos^4 is below 1e-20
_INFINITE = 1e5


@compiled
def _half_plane(chart: Array, direction: Array, height: float, reach: float) -> Array:
    """Return the part of a flat chart in front of a horizon as a half-plane (c = -1: none of it).

    Parameters
    ----------
    chart : ndarray
        Flat chart.
    direction : ndarray, shape (3,)
        Unit normal of the horizon, towards its front.
    height : float
        How far the chart's origin lies in front of it.
    reach : float
        Radius beyond which a boundary does not matter.
    """
    gu, gv = dot3(direction, chart[1:4]), dot3(direction, chart[4:7])
    slope = math.hypot(gu, gv)
    line = np.zeros(3)
    if height > slope * reach:
        line[2] = math.inf
    elif slope == 0.0 or -height > slope * reach:
        line[2] = -math.inf
    else:
        line[0], line[1], line[2] = -gu / slope, -gv / slope, height / slope
    return line


@compiled
def _flat(surface: Array, head: Array, table: Array, material: Array, late: float) -> Chart:
    chart = np.zeros(33)
    chart[0] = FLAT
    for i in range(1, 10):
        chart[i] = surface[3 + i]
    to_e, to_d = arms(surface, head)
    height_i, height_o = dot3(to_e, surface[10:13]), dot3(to_d, surface[10:13])
    if height_i < 0.0 or (height_i == 0.0 and height_o < 0.0):
        for i in range(7, 10):
            chart[i] = -chart[i]
        height_i, height_o = -height_i, -height_o
    none = np.empty(0)
    empty = (np.empty((0, 3)), np.zeros(3))
    marks = (none, np.empty((0, 3)), np.empty((0, 4)), none, none)
    if height_o < 0.0:
        return OPPOSITE, chart, empty, marks
    if height_i == 0.0 or height_o == 0.0:
        return EDGE_ON, chart, empty, marks
    together = to_e[0] == to_d[0] and to_e[1] == to_d[1] and to_e[2] == to_d[2]
    plain = head[12] == 0.0 or (head[12] == 1.0 and head[13] == 1.0)
    chart[31] = 1.0 if together and plain else 0.0
    u, v = chart[1:4], chart[4:7]
    ue, ve, ud, vd = dot3(to_e, u), dot3(to_e, v), dot3(to_d, u), dot3(to_d, v)
    share = height_i / (height_i + height_o)
    qu, qv = ue + (ud - ue) * share, ve + (vd - ve) * share
    for i in range(3):
        chart[12 + i] = u[i] * (qu - ue) + v[i] * (qv - ve) - chart[7 + i] * height_i
        chart[15 + i] = u[i] * (qu - ud) + v[i] * (qv - vd) - chart[7 + i] * height_o
    chart[18], chart[19] = height_i, height_o
    both = 2.0 * height_o * share  # harmonic mean: the slope of the half vector is rho / both
    chart[11] = min(height_i, height_o)
    baseline = math.hypot(ud - ue, vd - ve)
    circle = np.zeros(3)
    reach = 0.0
    edges = 0
    lines = np.empty((6, 3))
    if surface[0] == RECTANGLE:
        a, b = surface[13], surface[14]
        for i in range(2):
            sign = 1.0 - 2.0 * i
            lines[i, 0], lines[i, 1], lines[i, 2] = sign, 0.0, a - sign * qu
            lines[2 + i, 0], lines[2 + i, 1], lines[2 + i, 2] = 0.0, sign, b - sign * qv
        edges = 4
        reach = math.hypot(abs(qu) + a, abs(qv) + b)
    elif surface[0] == DISK:
        circle[0], circle[1], circle[2] = -qu, -qv, surface[13]
        reach = math.hypot(qu, qv) + surface[13]
    else:
        circle[2] = _INFINITE * (max(height_i, height_o) + baseline)
        reach = circle[2]
    for i in range(2):
        direction = head[9:12] if i == 0 else head[3:6]
        base = chart[15:18] if i == 0 else chart[12:15]
        line = _half_plane(chart, direction, dot3(direction, base), reach)
        if line[2] == -math.inf:
            return OUT_OF_VIEW, chart, empty, marks
        if line[2] < math.inf:
            for j in range(3):
                lines[edges, j] = line[j]
            edges += 1
    rings = np.empty(2)
    count = 0
    if material[1] > 0.0 and material[5] == 0.0:
        rings[count] = both  # the kink of min(1, 2 cos^2)
        count += 1
    # where the pulse starts to be all late; exact for a common point of emitter and detector
    mean = 0.5 * (height_i + height_o)
    if late > mean:
        rings[count] = math.sqrt((late - mean) * (late + mean))
        count += 1
    lobes = none
    if material[1] > 0.0:
        lobes = lobe_radii(material[2] * both)
        chart[32] = 1.0 if together and material[0] == 0.0 else 0.0
    features = np.empty((0, 3))
    spread = spread_angle(head)
    sink = -dot3(head[3:6], chart[7:10])
    if spread >= 0.0 and sink > 1e-3:
        run = height_i / sink
        features = np.empty((1, 3))
        features[0, 0] = dot3(chart[1:4], head[3:6]) * run - dot3(chart[1:4], chart[12:15])
        features[0, 1] = dot3(chart[4:7], head[3:6]) * run - dot3(chart[4:7], chart[12:15])
        # a cone cuts the plane in an ellipse that is longer the more it grazes
        features[0, 2] = 1.05 * run * math.tan(spread) / sink
    marks = (rings[:count].copy(), features, np.empty((0, 4)), lobes, cone_cosines(head, table))
    return LIT, chart, (lines[:edges].copy(), circle), marks


@compiled
def build_chart(surface: Array, head: Array, table: Array, material: Array, late: float) -> Chart:
    """Return the chart of a surface, its region and its marks.

    Parameters
    ----------
    surface : ndarray, shape (15,)
        Row of a surface.
    head, table, material : ndarray
        Packed emitter and detector, table of the emitter, reflectance.
    late : float
        r0 of a pulse [m], 0 for none.

    Returns
    -------
    status : int
        LIT, or why there is no light.
    chart : ndarray
        See `simulator.optics.geometry`.
    region, marks : tuple of ndarray
        See `simulator.optics.quadrature.integrate`.
    """
    if surface[0] == ROUND:
        return sphere_chart(surface, head, material, late)
    return _flat(surface, head, table, material, late)
