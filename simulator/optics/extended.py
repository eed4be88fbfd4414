"""Extended emitters as an area quadrature of points (docs/model.md, 2.17)."""

import math

import numpy as np

from simulator.optics.emitters import Emitter
from simulator.optics.vectors import cross, normalised

__all__ = ["point_emitters"]


def point_emitters(emitter: Emitter, points: int = 5) -> list[tuple[float, Emitter]]:
    """Return points and weights that stand for an extended emitter.

    The integrand is smooth over an emitter that is small against the distance, so that a Gauss rule
    of 5 x 5 points leaves (size/distance)^10.

    Parameters
    ----------
    emitter : Emitter
        A point emitter is returned as it is.
    points : int
        Per side.

    Returns
    -------
    list of (float, Emitter)
        Weights sum to 1; each emitter is a point of the same pattern, aim and power.
    """
    if emitter.size_m is None:
        return [(1.0, emitter)]
    aim = emitter.aim
    helper = (0.0, 1.0, 0.0) if abs(aim[1]) < 0.9 else (0.0, 0.0, 1.0)
    u = normalised(cross(helper, aim))
    v = cross(aim, u)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    sources = []
    for x, wx in zip(nodes.tolist(), weights.tolist(), strict=True):
        for y, wy in zip(nodes.tolist(), weights.tolist(), strict=True):
            a, b = 0.5 * emitter.size_m[0] * x, 0.5 * emitter.size_m[1] * y
            place = tuple(
                math.fsum((p, a * s, b * t))
                for p, s, t in zip(emitter.position_m, u, v, strict=True)
            )
            update = {"position_m": place, "size_m": None}
            sources.append((0.25 * wx * wy, emitter.model_copy(update=update)))
    return sources
