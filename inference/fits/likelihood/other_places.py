"""Starts beyond walls: the ranges pulled far from a maximum, or an unknown held elsewhere.

Maxima that are as good lie apart along what the ranges share, with walls between them that grow
with the square of the readings over their noise. A climb does not cross one; a pull that is stiffer
than the wall does, and what it costs on the way says nothing of what lies behind.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_climb import Pull, begun, climbed
from inference.fits.likelihood.erring_point import Point, point_at, standard
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.range_walks import shared_of, sums_of

__all__ = ["beyond_walls"]

Array = NDArray[np.float64]

_OFFSETS = (0.12, 0.24, 0.36, 0.5, 0.65, 0.8, 1.0, 1.3)  # of mean log r, to where it is pulled
_WITHIN = 1e-3  # of log r, how near it has to come
_STEPS = 12  # of a climb while it is pulled
_HELD = (-1.5, -0.75, 0.0, 0.75, 1.5)  # standard deviations of the priors
_CLOSE = 0.3  # of them: it is there already
_RELEASED = 30  # steps after that


def beyond_walls(problem: FitProblem, base: Erring) -> list[tuple[Point, float]]:
    """Climb from where ranges are pulled away from a maximum, and from unknowns held elsewhere.

    Parameters
    ----------
    problem : FitProblem
        The problem, with priors of the unknowns.
    base : Erring
        Its maximum.

    Returns
    -------
    list of (Point, float)
        Ends of short climbs without pull, and the deviance that a step would still gain.
    """
    found = []
    shared = shared_of(base)
    for weights in sums_of(base, shared):
        weights = weights / np.abs(weights).sum()
        for sign in (1.0, -1.0):
            found += _pulled(problem, base, shared, sign * weights)
    return [*found, *_held(problem, base)]


def _pulled(
    problem: FitProblem, base: Erring, shared: Array, weights: Array
) -> list[tuple[Point, float]]:
    """Climb from where a sum of log ranges is pulled farther and farther."""
    told = weights @ shared
    variance = float(told @ told)
    if not variance > 0.0:
        return []
    of_x, _ = base.whole.factors
    ahead = of_x @ told / variance
    start, before, found = float(weights @ np.nan_to_num(base.positions)), 0.0, []
    x, u = base.x, base.positions
    for offset in _OFFSETS:
        begin = np.clip(x + (offset - before) * ahead, *problem.bounds(x))
        pull = Pull(weights, start + offset, 1.0 / _WITHIN)
        at, _ = climbed(problem, begun(problem, begin, u), _STEPS, pull=pull)
        if not math.isfinite(at.deviance):
            break
        found.append(climbed(problem, at, _RELEASED))
        x, u, before = at.x, at.u, offset
    return found


def _held(problem: FitProblem, base: Erring) -> list[tuple[Point, float]]:
    """Climb from each unknown but crosstalk held elsewhere in its prior for a while."""
    found = []
    none = np.zeros_like(base.a)
    z = standard(problem, base.x[None])[0]
    whole = np.zeros((1, len(problem.parameters)))
    for j in np.flatnonzero(~np.isin(problem.slots, CROSSTALK)).tolist():
        for value in _HELD:
            if abs(z[j] - value) < _CLOSE:
                continue
            whole[0, problem.columns] = np.where(np.arange(z.size) == j, value, z)
            natural = problem.parameters.natural(whole)[:, problem.columns]
            x = base.x.copy()
            x[j] = problem.coordinates(natural)[0, j]
            if not math.isfinite(x[j]):
                continue
            x = np.clip(x, *problem.bounds(x))
            at, _ = climbed(problem, point_at(problem, x, base.positions, none), _STEPS, held=j)
            if math.isfinite(at.deviance):
                found.append(climbed(problem, at, _RELEASED))
    return found
