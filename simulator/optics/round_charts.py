"""Charts of what is round: a sphere from outside, a shell from inside."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.geometry import SHELL, SPHERE
from simulator.optics.marks import (
    INSIDE,
    LIT,
    OPPOSITE,
    OUT_OF_VIEW,
    Chart,
    arms,
    dot3,
    lobe_radii,
    spread_angle,
)

__all__ = ["shell_chart", "sphere_chart"]

Array = NDArray[np.float64]


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
def sphere_chart(surface: Array, head: Array, material: Array, late: float) -> Chart:
    """Chart of a sphere about its point nearest the sensor; arguments as for `build_chart`."""
    chart = np.zeros(33)
    chart[0] = SPHERE
    radius = surface[13]
    chart[10] = radius
    to_e, to_d = arms(surface, head)
    size_e, size_d = math.sqrt(dot3(to_e, to_e)), math.sqrt(dot3(to_d, to_d))
    none = np.empty(0)
    empty = (np.empty((0, 3)), np.zeros(3))
    marks = (none, np.empty((0, 3)), np.empty((0, 4)), none, none)
    if size_e <= radius or size_d <= radius:
        return INSIDE, chart, empty, marks
    if dot3(head[9:12], to_d) >= radius or dot3(head[3:6], to_e) >= radius:
        return OUT_OF_VIEW, chart, empty, marks
    axis = np.empty(3)
    for i in range(3):
        axis[i] = to_e[i] / size_e + to_d[i] / size_d
    length = math.sqrt(dot3(axis, axis))
    if length < 1e-9:  # emitter and detector on opposite sides
        return OPPOSITE, chart, empty, marks
    for i in range(3):
        chart[7 + i] = axis[i] / length
        chart[12 + i] = radius * chart[7 + i] - to_e[i]
        chart[15 + i] = radius * chart[7 + i] - to_d[i]
    _frame(chart)
    # the farther horizon of the two, as an angle at the centre
    angle_e = math.acos(min(dot3(chart[7:10], to_e) / size_e, 1.0))
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
        planes[i, 3] = dot3(head[first : first + 3], arm) / radius
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
        lobes = lobe_radii(material[2] * gap / size)
    features = np.empty((0, 3))
    spread = spread_angle(head)
    along = -dot3(head[3:6], to_e)
    across2 = size_e * size_e - along * along
    if spread >= 0.0 and along > 0.0 and across2 < radius * radius:
        run = along - math.sqrt(radius * radius - across2)
        hit = np.empty(3)
        for i in range(3):
            hit[i] = (to_e[i] + run * head[3 + i]) / radius
        cosine = dot3(hit, chart[7:10])
        # Lambert's equal-area projection about the axis
        stretch = math.sqrt(2.0 / (1.0 + cosine)) if cosine > -0.999 else 0.0
        features = np.empty((1, 3))
        features[0, 0] = dot3(hit, chart[1:4]) * stretch
        features[0, 1] = dot3(hit, chart[4:7]) * stretch
        slant = -dot3(head[3:6], hit)
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
    spread = spread_angle(head)
    if spread >= 0.0:
        x, y = dot3(head[3:6], chart[1:4]), dot3(head[3:6], chart[4:7])
        sine = math.hypot(x, y)
        angle = math.atan2(sine, dot3(head[3:6], chart[7:10]))
        features = np.zeros((1, 3))
        if sine > 0.0:
            features[0, 0], features[0, 1] = angle * x / sine, angle * y / sine
        features[0, 2] = spread
    none = np.empty(0)
    return LIT, chart, (np.empty((0, 3)), circle), (none, features, planes, none, none)
