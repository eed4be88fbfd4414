"""What it costs that a frame's range is the farthest that is possible, everything else following.

A frame whose light is a few times its noise, or what is open of the crosstalk, may have none. Its
range is then any beyond: the deviance rises by 2 or 3 to the end of the ranges, where curvature at
the best fit foresees hundreds. The truth was seen 40 standard deviations off.
"""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.erring_point import Point
from inference.fits.likelihood.erring_profile import LOOSE, holding
from inference.fits.likelihood.frame_modes import nearest_modes
from inference.fits.likelihood.problem import FitProblem

__all__ = ["far_ends"]

Array = NDArray[np.float64]

_ENOUGH = 9.0  # deviance that three standard deviations cost, beyond which an end says nothing
_CLIMBS = 5  # frames whose ranges are held at the end
_STEPS = 12  # of such a climb
_LEAST = 1e-3  # deviance, below which all are alike


def far_ends(problem: FitProblem, top: Erring, doubt: float = 1.0) -> Array:
    """Return by how much the deviance rises to where a frame's range is at its far end.

    Parameters
    ----------
    problem : FitProblem
        The problem, of the mode of its best maximum.
    top : Erring
        The maximum.
    doubt : float
        By what the variance of noise may be larger than stated.

    Returns
    -------
    ndarray, shape (n,)
        inf where the range is told well, or by more than readings, or where its end is ruled out
        by three standard deviations. Of more than a few frames it is interpolated between those
        that are as dark.
    """
    rises = np.full(top.positions.size, np.inf)
    if problem.known is not None or not len(problem):
        return rises
    own, _, whole, _ = top.at_ranges(top.positions)
    loose = np.flatnonzero(np.isfinite(whole) & (whole > LOOSE) & (own > 0.0))
    if not loose.size:
        return rises
    # how dark a frame is: a linear answer of all else says 6 where a climb says 72
    order = loose[np.argsort(-own[loose], kind="stable")]
    costs = _costs(problem, top, order.tolist(), doubt * _ENOUGH)
    ranks = sorted(costs)
    beyond = next((rank for rank in ranks if costs[rank] >= doubt * _ENOUGH), order.size)
    told = [rank for rank in ranks if rank <= beyond]
    if told == [0] and beyond == 0:
        return rises
    dark = order[:beyond]
    # what costs more than anything says nothing of how fast that comes
    each = np.log(np.clip([costs[rank] for rank in told], _LEAST, 4.0 * doubt * _ENOUGH))
    darkness = -np.log(own[order])
    found = np.exp(np.interp(darkness[:beyond], darkness[told], each))
    rises[dark] = np.where(found < doubt * _ENOUGH, found, np.inf)
    return rises


def _costs(problem: FitProblem, top: Erring, frames: list[int], enough: float) -> dict[int, float]:
    """Hold the darkest frame at the end, then brighter ones; costs by rank."""
    found = {0: _held(problem, frames[0], top.x, top.positions)}
    costs = {0: found[0].deviance - top.deviance}
    while len(found) < _CLIMBS:
        ranks = [*sorted(found), len(frames)]
        if costs[ranks[-2]] < enough:  # farther on, to where frames are too bright
            before = ranks[-2]
            rank = min(max(2 * before + 1, len(frames) // 8), len(frames) - 1)
        else:
            pairs = [two for two in itertools.pairwise(ranks[:-1]) if costs[two[0]] < enough]
            before, later = max(pairs, key=lambda two: two[1] - two[0], default=(0, 0))
            rank = (before + later) // 2
        if rank in found:
            break
        start = found[before]  # where much is as it will be
        found[rank] = _held(problem, frames[rank], start.x, start.u)
        costs[rank] = found[rank].deviance - top.deviance
    return costs


def _held(problem: FitProblem, frame: int, x: Array, u: Array) -> Point:
    """Climb with the range of a frame held at the far end."""
    held = holding(problem, frame, math.log(problem.support[1]))
    return climbed(held, begun(held, x, nearest_modes(problem, x, u)), _STEPS)[0]
