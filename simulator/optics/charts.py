"""From a surface and a sensor head to a chart: where to integrate, and what is sharp where."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.geometry import FLAT, SHELL, SPHERE

__all__ = [
    "DISK",
    "EDGE_ON",
    "INSIDE",
    "LIT",
    "OPPOSITE",
    "OUT_OF_VIEW",
    "PLANE",
    "RECTANGLE",
    "ROUND",
    "build_chart",
    "shell_chart",
]

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Chart = tuple[int, Array, tuple[Array, Array], tuple[Array, Array, Array, Array, Array]]

# kinds of surface rows: kind 0, centre 1:4, width axis 4:7, height axis 7:10, normal 10:13,
# half sizes (or radius) 13:15
RECTANGLE, DISK, PLANE, ROUND = 0.0, 1.0, 2.0, 3.0
LIT, EDGE_ON, OPPOSITE, OUT_OF_VIEW, INSIDE = 0, 1, 2, 3, 4

# an infinite plane ends where cos^4 is below 1e-20
_INFINITE = 1e5


@compiled
def _dot(a: Array, b: Array) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def _arms(surface: Array, head: Array) -> tuple[Array, Array]:
    """Return emitter and detector as seen from the surface's centre."""
    to_e, to_d = np.empty(3), np.empty(3)
    for i in range(3):
        to_e[i] = head[i] - surface[1 + i]
        to_d[i] = head[6 + i] - surface[1 + i]
    return to_e, to_d


@compiled
def _lobes(width: float) -> Array:
    """Return the radii at which a lobe is cut into pieces."""
    lobes = np.empty(3)
    lobes[0], lobes[1], lobes[2] = 1.5 * width, 4.0 * width, 8.0 * width
    return lobes


@compiled
def _spread(head: Array) -> float:
    """Return the angle over which the emitter's pattern is sharp, 0 for a cusp, -1 if nowhere."""
    if head[12] == 0.0 or (head[12] == 1.0 and head[13] <= 4.0):
        return -1.0
    if head[12] == 1.0:
        return 3.0 / math.sqrt(head[13])
    if head[12] == 2.0:
        return 0.0
    return float(min(head[15], 1.4))


@compiled
def _cones(head: Array, table: Array) -> Array:
    """Return the cosines of the angles at which the emitter's pattern has a kink."""
    if head[12] == 3.0:
        return np.array([math.cos(head[13])])
    if head[12] == 4.0:
        cosines = np.empty(table.shape[1])
        for i in range(cosines.size):
            cosines[i] = math.cos(table[0, i])
        return cosines
    return np.empty(0)


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
    gu, gv = _dot(direction, chart[1:4]), _dot(direction, chart[4:7])
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
    to_e, to_d = _arms(surface, head)
    height_i, height_o = _dot(to_e, surface[10:13]), _dot(to_d, surface[10:13])
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
    ue, ve, ud, vd = _dot(to_e, u), _dot(to_e, v), _dot(to_d, u), _dot(to_d, v)
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
        line = _half_plane(chart, direction, _dot(direction, base), reach)
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
        lobes = _lobes(material[2] * both)
        chart[32] = 1.0 if together and material[0] == 0.0 else 0.0
    features = np.empty((0, 3))
    spread = _spread(head)
    sink = -_dot(head[3:6], chart[7:10])
    if spread >= 0.0 and sink > 1e-3:
        run = height_i / sink
        features = np.empty((1, 3))
        features[0, 0] = _dot(chart[1:4], head[3:6]) * run - _dot(chart[1:4], chart[12:15])
        features[0, 1] = _dot(chart[4:7], head[3:6]) * run - _dot(chart[4:7], chart[12:15])
        # a cone cuts the plane in an ellipse that is longer the more it grazes
        features[0, 2] = 1.05 * run * math.tan(spread) / sink
    marks = (rings[:count].copy(), features, np.empty((0, 4)), lobes, _cones(head, table))
    return LIT, chart, (lines[:edges].copy(), circle), marks


@compiled
def _frame(chart: Array) -> None:
    """Complete the axis in chart[7:10] to an orthonormal frame."""
    x, y, z = chart[7], chart[8], chart[9]
    # across the smaller of two components
    if abs(x) < abs(y):
        size = math.hypot(y, z)
        chart[1], chart[2], chart[3] = 0.0, z / size, -y / size
    else:
        size = math.hypot(x, z)
        chart[1], chart[2], chart[3] = -z / size, 0.0, x / size
    chart[4] = y * chart[3] - z * chart[2]
    chart[5] = z * chart[1] - x * chart[3]
    chart[6] = x * chart[2] - y * chart[1]


@compiled
def _round(surface: Array, head: Array, material: Array, late: float) -> Chart:
    chart = np.zeros(33)
    chart[0] = SPHERE
    radius = surface[13]
    chart[10] = radius
    to_e, to_d = _arms(surface, head)
    size_e, size_d = math.sqrt(_dot(to_e, to_e)), math.sqrt(_dot(to_d, to_d))
    none = np.empty(0)
    empty = (np.empty((0, 3)), np.zeros(3))
    marks = (none, np.empty((0, 3)), np.empty((0, 4)), none, none)
    if size_e <= radius or size_d <= radius:
        return INSIDE, chart, empty, marks
    if _dot(head[9:12], to_d) >= radius or _dot(head[3:6], to_e) >= radius:
        return OUT_OF_VIEW, chart, empty, marks
    axis = np.empty(3)
    for i in range(3):
        axis[i] = to_e[i] / size_e + to_d[i] / size_d
    length = math.sqrt(_dot(axis, axis))
    if length < 1e-9:  # emitter and detector on opposite sides
        return OPPOSITE, chart, empty, marks
    for i in range(3):
        chart[7 + i] = axis[i] / length
        chart[12 + i] = radius * chart[7 + i] - to_e[i]
        chart[15 + i] = radius * chart[7 + i] - to_d[i]
    _frame(chart)
    # the farther horizon of the two, as an angle at the centre
    angle_e = math.acos(min(_dot(chart[7:10], to_e) / size_e, 1.0))
    gap_e, gap_d = size_e - radius, size_d - radius
    widest = 0.0
    for i in range(2):
        gap, size = (gap_e, size_e) if i == 0 else (gap_d, size_d)
        # 2 asin(sqrt((1 - R/d)/2)) is acos(R/d) without its cancellation
        psi = 2.0 * math.asin(math.sqrt(0.5 * gap / size)) + angle_e
        widest = max(widest, psi)
    circle = np.zeros(3)
    circle[2] = 2.0 * math.sin(0.5 * min(widest, math.pi))
    gap, size = min(gap_e, gap_d), 0.5 * (size_e + size_d)
    chart[11] = min(gap / math.sqrt(size * radius), 4.0)
    together = to_e[0] == to_d[0] and to_e[1] == to_d[1] and to_e[2] == to_d[2]
    planes = np.empty((4, 4))
    for i in range(2):
        first = 9 - 6 * i
        arm = to_d if i == 0 else to_e
        for j in range(3):
            planes[i, j] = head[first + j]
            planes[3 - i, j] = arm[j]
        planes[i, 3] = _dot(head[first : first + 3], arm) / radius
        planes[3 - i, 3] = radius
    rings = np.empty(2)
    count = 0
    if material[1] > 0.0 and material[5] == 0.0:
        # the sine rule of the triangle centre, sensor, point at 45 degrees of incidence
        psi = 0.25 * math.pi - math.asin(radius * math.sqrt(0.5) / size)
        rings[count] = 2.0 * math.sin(0.5 * psi)
        count += 1
    if late > gap:
        square = (late - gap) * (late + gap) / (radius * size)
        if square < 4.0:
            rings[count] = math.sqrt(square)
            count += 1
    lobes = none
    if material[1] > 0.0:
        lobes = _lobes(material[2] * gap / size)
    features = np.empty((0, 3))
    spread = _spread(head)
    along = -_dot(head[3:6], to_e)
    across2 = size_e * size_e - along * along
    if spread >= 0.0 and along > 0.0 and across2 < radius * radius:
        run = along - math.sqrt(radius * radius - across2)
        hit = np.empty(3)
        for i in range(3):
            hit[i] = (to_e[i] + run * head[3 + i]) / radius
        cosine = _dot(hit, chart[7:10])
        # Lambert's equal-area projection about the axis
        stretch = math.sqrt(2.0 / (1.0 + cosine)) if cosine > -0.999 else 0.0
        features = np.empty((1, 3))
        features[0, 0] = _dot(hit, chart[1:4]) * stretch
        features[0, 1] = _dot(hit, chart[4:7]) * stretch
        slant = -_dot(head[3:6], hit)
        features[0, 2] = 1.05 * run * math.tan(spread) / (radius * max(slant, 0.1))
    marks = (rings[:count].copy(), features, planes[: 2 if together else 4].copy(), lobes, none)
    return LIT, chart, (np.empty((0, 3)), circle), marks


@compiled
def shell_chart(backdrop: Array, head: Array) -> Chart:
    """Chart of a shell around the sensor, by directions from the detector."""
    chart = np.zeros(33)
    chart[0] = SHELL
    for i in range(3):
        chart[7 + i] = head[9 + i]
    _frame(chart)
    chart[11] = 1.0
    for i in range(13):
        chart[20 + i] = backdrop[i]
    circle = np.zeros(3)
    circle[2] = 0.5 * math.pi
    planes = np.zeros((1, 4))
    for i in range(3):
        planes[0, i] = head[3 + i]
    features = np.empty((0, 3))
    spread = _spread(head)
    if spread >= 0.0:
        x, y = _dot(head[3:6], chart[1:4]), _dot(head[3:6], chart[4:7])
        sine = math.hypot(x, y)
        angle = math.atan2(sine, _dot(head[3:6], chart[7:10]))
        features = np.zeros((1, 3))
        if sine > 0.0:
            features[0, 0], features[0, 1] = angle * x / sine, angle * y / sine
        features[0, 2] = spread
    none = np.empty(0)
    return LIT, chart, (np.empty((0, 3)), circle), (none, features, planes, none, none)


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
        return _round(surface, head, material, late)
    return _flat(surface, head, table, material, late)
