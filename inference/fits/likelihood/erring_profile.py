"""Profile likelihood of the ranges where the model errs and ranges are told loosely.

Behind unknown crosstalk the light of a far frame may be mostly crosstalk: its range runs away where
the crosstalk comes near its reading, and stays where it goes the other way. Neither curvature nor
unknowns that are held one by one tell how far such a range reaches: the best fit was seen at a
third of the true range, 7.6 standard deviations off, at a deviance of 3. So the range of a frame is
held itself, nearer and farther, and everything else follows.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import KnownRanges

__all__ = ["LOOSE", "holding", "profiles"]

Array = NDArray[np.float64]

LOOSE = 0.1  # standard deviation of log r, from which the tangent is no longer the curve
_FRAMES = 2  # whose ranges are held: the loosest, and one in the middle of those that are loose
_STEPS = 12  # of a climb with a range held
_HELD = 1e3  # one over the relative standard deviation of a range that is held
_FIRST = 2.0  # standard deviations to where a range is held first
_STRIDE = 0.7  # most that log r is moved at once
_ENOUGH = 4.0  # deviance that two standard deviations cost
_TOO_FAR = 8.0  # deviance of points that say nothing any more
_TRIES = 7


def profiles(problem: FitProblem, top: Erring) -> list[Erring]:
    """Hold ranges that are told loosely.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    top : Erring
        Its best maximum.

    Returns
    -------
    list of Erring
        Points that are optimal but for one range; none where ranges are told well, or are known.
        A better one than the best maximum is a point as the others: an error as large as the
        ranges makes such of frames at the end of what is possible.
    """
    points: list[Erring] = []
    if problem.known is not None or not len(problem):
        return points
    own, _, whole, _ = top.at_ranges(top.positions)
    # what is a frame's own is followed frame by frame (`frame_reaches`)
    loose = np.flatnonzero(np.isfinite(whole) & (whole > np.hypot(LOOSE, own)))
    order = loose[np.argsort(-whole[loose], kind="stable")]
    for frame in order[:: max(1, order.size // _FRAMES)][:_FRAMES].tolist():
        for sign in (1.0, -1.0):
            points += _side(problem, top, frame, sign * float(whole[frame]))
    return points


def _side(problem: FitProblem, top: Erring, frame: int, sd: float) -> list[Erring]:
    """Hold the range of a frame on one side, which the sign of `sd` tells."""
    points: list[Erring] = []
    low, high = np.log(problem.support)
    x, u, near, far, reach = top.x, top.positions, 0.0, math.inf, _FIRST * abs(sd)
    sign = math.copysign(1.0, sd)
    for _ in range(_TRIES):
        reach = min(reach, near + _STRIDE)
        value = float(np.clip(top.positions[frame] + sign * reach, low, high))
        held = holding(problem, frame, value)
        at, _ = climbed(held, begun(held, x, u), _STEPS)
        cost = at.deviance - top.deviance
        if not math.isfinite(cost):
            break
        if cost < _TOO_FAR:
            points.append(end_of(held, at, 0.0))
        if _ENOUGH <= cost < _TOO_FAR or (cost < _ENOUGH and value in (low, high)):
            break
        if cost < _ENOUGH:
            x, u, near = at.x, at.u, reach
        else:
            far = reach
        reach = 2.0 * near if math.isinf(far) else 0.5 * (near + far)
    return points


def holding(problem: FitProblem, frame: int, u: float) -> FitProblem:
    """Return the problem with the range of a frame known.

    Parameters
    ----------
    problem : FitProblem
        The problem, of which nothing else of the ranges is known.
    frame : int
        Which.
    u : float
        Its log r.
    """
    values, rates = np.zeros((2, *problem.frames[:, :2].shape))
    values[frame, 0], rates[frame, 0] = math.exp(u), _HELD * math.exp(-u)
    return dataclasses.replace(problem, known=KnownRanges(values, rates, 0.0, 0.0))
