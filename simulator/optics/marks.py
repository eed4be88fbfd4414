"""What the charts share: kinds of surfaces, statuses, and where an emitter is sharp."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

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
    "Chart",
    "arms",
    "cone_cosines",
    "dot3",
    "lobe_radii",
    "spread_angle",
]

Array = NDArray[np.float64]
Chart = tuple[int, Array, tuple[Array, Array], tuple[Array, Array, Array, Array, Array]]

# kinds of surface rows: kind 0, centre 1:4, width axis 4:7, height axis 7:10, normal 10:13,
# half sizes (or radius) 13:15
RECTANGLE, DISK, PLANE, ROUND = 0.0, 1.0, 2.0, 3.0
LIT, EDGE_ON, OPPOSITE, OUT_OF_VIEW, INSIDE = 0, 1, 2, 3, 4


@compiled
def dot3(a: Array, b: Array) -> float:
    """Return the scalar product of two vectors."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def arms(surface: Array, head: Array) -> tuple[Array, Array]:
    """Return emitter and detector as seen from the surface's centre."""
    to_e, to_d = np.empty(3), np.empty(3)
    for i in range(3):
        to_e[i] = head[i] - surface[1 + i]
        to_d[i] = head[6 + i] - surface[1 + i]
    return to_e, to_d


@compiled
def lobe_radii(width: float) -> Array:
    """Return the radii at which a lobe is cut into pieces."""
    lobes = np.empty(3)
    lobes[0], lobes[1], lobes[2] = 1.5 * width, 4.0 * width, 8.0 * width
    return lobes


@compiled
def spread_angle(head: Array) -> float:
    """Return the angle over which the emitter's pattern is sharp, 0 for a cusp, -1 if nowhere."""
    if head[12] == 0.0 or (head[12] == 1.0 and head[13] <= 4.0):
        return -1.0
    if head[12] == 1.0:
        return 3.0 / math.sqrt(head[13])
    if head[12] == 2.0:
        return 0.0
    return float(min(head[15], 1.4))


@compiled
def cone_cosines(head: Array, table: Array) -> Array:
    """Return the cosines of the angles at which the emitter's pattern has a kink."""
    if head[12] == 3.0:
        return np.array([math.cos(head[13])])
    if head[12] == 4.0:
        cosines = np.empty(table.shape[1])
        for i in range(cosines.size):
            cosines[i] = math.cos(table[0, i])
        return cosines
    return np.empty(0)
