"""The lit and seen part of a flat surface, in polar coordinates about its mirror point.

A flat surface is a convex region of the plane: half-planes (its edges, and the horizons of emitter
and detector) and at most one circle. About the point that mirrors the emitter into the detector
the integrand is smooth along rays (a specular lobe, and the kink of its masking, are rings), so the
region is cut into angular sectors on whose rays the ends are smooth functions of the angle.

Half-planes are rows (nx, ny, c): points p with n . p <= c; circles are (x, y, radius),
and a radius of zero stands for none.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["ARC", "LINE", "SWEEP", "ray", "sectors"]

Array = NDArray[np.float64]

SWEEP, ARC, LINE = 0.0, 1.0, 2.0


@compiled
def ray(lines: Array, circle: Array, x: float, y: float) -> tuple[float, float, int]:
    """Cut the ray from the origin along (x, y) by the region.

    Returns
    -------
    near, far : float
        Where the ray enters and leaves; empty if near >= far.
    which : int
        Index of the line that ends it, -1 for the circle.
    """
    near, far, which = 0.0, math.inf, -1
    for i in range(lines.shape[0]):
        slope = lines[i, 0] * x + lines[i, 1] * y
        c = lines[i, 2]
        if slope > 0.0:
            if c < far * slope:
                far, which = c / slope, i
        elif slope < 0.0:
            near = max(near, c / slope)
        elif c < 0.0:
            return 0.0, 0.0, -1
    if circle[2] > 0.0:
        along = x * circle[0] + y * circle[1]
        across = x * circle[1] - y * circle[0]
        inside = (circle[2] - across) * (circle[2] + across)
        if inside <= 0.0:
            return 0.0, 0.0, -1
        half = math.sqrt(inside)
        # (far end) (near end) = |centre|^2 - radius^2, without the difference of squares
        size = math.hypot(circle[0], circle[1])
        power = (size - circle[2]) * (size + circle[2])
        if along >= 0.0:
            last = along + half
            first = power / last if last > 0.0 else 0.0
        else:
            first = along - half
            last = power / first
        near = max(near, first)
        if last < far:
            far, which = last, -1
    return near, far, which


@compiled
def _inside(lines: Array, circle: Array, x: float, y: float, slack: float) -> bool:
    for i in range(lines.shape[0]):
        if lines[i, 0] * x + lines[i, 1] * y > lines[i, 2] + slack:
            return False
    distance = math.hypot(x - circle[0], y - circle[1])
    return bool(circle[2] <= 0.0 or distance <= circle[2] + slack)


@compiled
def _crossings(line: Array, x: float, y: float, radius: float) -> tuple[int, Array]:
    """Return the points where a line meets the circle about (x, y)."""
    points = np.empty((2, 2))
    h = line[2] - line[0] * x - line[1] * y
    square = (radius - h) * (radius + h)
    if square <= 0.0:
        return 0, points
    t = math.sqrt(square)
    for i in range(2):
        s = t if i == 0 else -t
        points[i, 0] = x + h * line[0] - s * line[1]
        points[i, 1] = y + h * line[1] + s * line[0]
    return 2, points


@compiled
def _corners(lines: Array, circle: Array) -> Array:
    """Return the corners of the region: where two of its boundaries meet on its rim."""
    k = lines.shape[0]
    found = np.empty((k * k + 2 * k + 2, 2))
    count = 0
    for i in range(k):
        for j in range(i):
            det = lines[i, 0] * lines[j, 1] - lines[i, 1] * lines[j, 0]
            if abs(det) < 1e-14:
                continue
            x = (lines[i, 2] * lines[j, 1] - lines[j, 2] * lines[i, 1]) / det
            y = (lines[i, 0] * lines[j, 2] - lines[j, 0] * lines[i, 2]) / det
            slack = 1e-12 * (abs(lines[i, 2]) + abs(lines[j, 2]) + math.hypot(x, y))
            if _inside(lines, circle, x, y, slack):
                found[count, 0], found[count, 1] = x, y
                count += 1
    if circle[2] > 0.0:
        for i in range(k):
            number, points = _crossings(lines[i], circle[0], circle[1], circle[2])
            for j in range(number):
                x, y = points[j, 0], points[j, 1]
                if _inside(lines, circle, x, y, 1e-12 * (circle[2] + math.hypot(x, y))):
                    found[count, 0], found[count, 1] = x, y
                    count += 1
    return found[:count]


@compiled
def _sort(values: Array, count: int) -> None:
    """Sort the first values by insertion: they are few, and numpy's sort is long to compile."""
    for i in range(1, count):
        value = values[i]
        j = i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value


@compiled
def sectors(
    lines: Array, circle: Array, rings: Array, features: Array
) -> tuple[Array, Array, float]:
    """Cut the region into angular sectors.

    Parameters
    ----------
    lines : ndarray, shape (k, 3)
        Half-planes.
    circle : ndarray, shape (3,)
        Circle; a radius of zero stands for none.
    rings : ndarray
        Radii about the origin at which the integrand has a kink.
    features : ndarray, shape (n, 3)
        Points of the plane, with a width, where the integrand is sharp.

    Returns
    -------
    panels : ndarray, shape (p, 5)
        Kind, first and last parameter, and for SWEEP and ARC mid and half angle, for LINE the
        index of the line and its scale; see `simulator.optics.quadrature`.
    reference : ndarray, shape (2,)
        Direction from which angles are counted.
    nearest : float
        Distance of the region from the origin.
    """
    corners = _corners(lines, circle)
    reference = np.array([1.0, 0.0])
    size = 0.0
    if corners.shape[0] > 0:
        x, y = 0.0, 0.0
        for i in range(corners.shape[0]):
            x += corners[i, 0] / corners.shape[0]
            y += corners[i, 1] / corners.shape[0]
            size = max(size, abs(corners[i, 0]), abs(corners[i, 1]))
    elif circle[2] > 0.0 and _inside(lines, circle, circle[0], circle[1], 0.0):
        x, y = circle[0], circle[1]
        size = circle[2] + math.hypot(x, y)
    else:
        return np.empty((0, 5)), reference, 0.0
    if math.hypot(x, y) > 1e-12 * size:
        reference[0], reference[1] = x / math.hypot(x, y), y / math.hypot(x, y)
    # the nearest point is a corner, the foot on an edge, or a point of the circle
    nearest = 0.0
    if not _inside(lines, circle, 0.0, 0.0, 0.0):
        nearest = math.inf
        for i in range(corners.shape[0]):
            nearest = min(nearest, math.hypot(corners[i, 0], corners[i, 1]))
        if circle[2] > 0.0:
            nearest = min(nearest, max(math.hypot(circle[0], circle[1]) - circle[2], 0.0))
    k = lines.shape[0]
    events = np.empty(
        (corners.shape[0] + k * (1 + 2 * rings.size) + 2 + 5 * features.shape[0] + 3, 2)
    )
    count = 0
    for i in range(corners.shape[0]):
        events[count, 0], events[count, 1] = corners[i, 0], corners[i, 1]
        count += 1
    # where an edge comes nearest, and where it leaves a ring
    for i in range(k):
        h = lines[i, 2]
        slack = 1e-12 * size
        if _inside(lines, circle, h * lines[i, 0], h * lines[i, 1], slack):
            events[count, 0], events[count, 1] = h * lines[i, 0], h * lines[i, 1]
            count += 1
            nearest = min(nearest, abs(h))
        for j in range(rings.size):
            number, points = _crossings(lines[i], 0.0, 0.0, rings[j])
            for m in range(number):
                if _inside(lines, circle, points[m, 0], points[m, 1], slack):
                    events[count, 0], events[count, 1] = points[m, 0], points[m, 1]
                    count += 1
    if circle[2] > 0.0:
        size_c = math.hypot(circle[0], circle[1])
        if size_c > circle[2]:  # tangents
            s = circle[2] / size_c
            c = math.sqrt((1.0 - s) * (1.0 + s))
            for turn in (-s, s):
                events[count, 0] = c * circle[0] - turn * circle[1]
                events[count, 1] = turn * circle[0] + c * circle[1]
                count += 1
    for i in range(features.shape[0]):
        fx, fy, width = features[i, 0], features[i, 1], features[i, 2]
        distance = math.hypot(fx, fy)
        if distance > 0.0:
            for multiple in (-3.0, -1.0, 0.0, 1.0, 3.0):
                shift = multiple * width / distance
                events[count, 0] = fx - shift * fy
                events[count, 1] = shift * fx + fy
                count += 1
    angles = np.empty(count + 2)
    used = 0
    for i in range(count):
        ex, ey = events[i, 0], events[i, 1]
        if ex != 0.0 or ey != 0.0:
            angles[used] = math.atan2(
                reference[0] * ey - reference[1] * ex, reference[0] * ex + reference[1] * ey
            )
            used += 1
    angles[used], angles[used + 1] = -math.pi, math.pi
    used += 2
    _sort(angles, used)
    panels = np.empty((used, 5))
    number = 0
    for i in range(used - 1):
        low, high = angles[i], angles[i + 1]
        if not high - low > 1e-15:
            continue
        middle = 0.5 * (low + high)
        c, s = math.cos(middle), math.sin(middle)
        dx = reference[0] * c - reference[1] * s
        dy = reference[1] * c + reference[0] * s
        near, far, which = ray(lines, circle, dx, dy)
        if not near < far:
            continue
        if which >= 0:
            h = lines[which, 2]
            # angle of the line's normal from the reference
            normal = math.atan2(
                reference[0] * lines[which, 1] - reference[1] * lines[which, 0],
                reference[0] * lines[which, 0] + reference[1] * lines[which, 1],
            )
            turn = middle - normal
            turn -= 2.0 * math.pi * round(turn / (2.0 * math.pi))
            first = turn - 0.5 * (high - low)
            last = turn + 0.5 * (high - low)
            limit = 0.5 * math.pi
            panels[number, 0] = LINE
            panels[number, 1] = h * math.tan(min(max(first, -limit), limit))
            panels[number, 2] = h * math.tan(min(max(last, -limit), limit))
            panels[number, 3] = which
        else:
            # an arc whose ends may be tangents: sin(psi) takes the square root away
            outside = circle[2] > 0.0 and math.hypot(circle[0], circle[1]) > circle[2]
            panels[number, 0] = ARC if outside else SWEEP
            panels[number, 1] = -0.5 * math.pi if outside else low
            panels[number, 2] = 0.5 * math.pi if outside else high
            panels[number, 3] = middle
            panels[number, 4] = 0.5 * (high - low)
        number += 1
    return panels[:number], reference, nearest
