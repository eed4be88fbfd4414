"""How far unknowns reach that curvature at the top calls certain, everything else following.

Valleys bend: what lies 5 standard deviations away by curvature may cost no more than 2. Of an exact
model by priors the ranges are pulled (`range_walks`), which tells little of an unknown
(docs/model.md, fit-priors).
"""

import math
from collections.abc import Sequence

import numpy as np

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.maximum import DECIDED
from inference.fits.likelihood.problem import FitProblem

__all__ = ["held_walks"]

_FIRST = 3.0  # standard deviations to where an unknown is held first
_FARTHER = 1.5  # of that, where it is held next
_MOST = 4  # times
_BENT = 0.5  # of what curvature foresees, below which a walk goes on
_STEPS = 30  # of a climb


def held_walks(problem: FitProblem, top: Erring, unknowns: Sequence[int]) -> list[Erring]:
    """Hold unknowns farther and farther away on both sides of a maximum.

    Parameters
    ----------
    problem : FitProblem
        The problem, with priors of the unknowns.
    top : Erring
        Its best maximum.
    unknowns : sequence of int
        Which coordinates.

    Returns
    -------
    list of Erring
        Points that are optimal but for what is held, and not decided against.
    """
    points = []
    of_x, _ = top.whole.factors
    for j in unknowns:
        sd = float(np.linalg.norm(of_x[j]))
        if not (math.isfinite(sd) and sd > 0.0):
            continue
        along = of_x @ of_x[j] / sd
        for sign in (1.0, -1.0):
            away = sign * _FIRST
            for _ in range(_MOST):
                x = np.clip(top.x + away * along, *problem.bounds(top.x))
                at, _ = climbed(problem, begun(problem, x, top.positions), _STEPS, held=j)
                excess = at.deviance - top.deviance
                if not excess < DECIDED:
                    break
                points.append(end_of(problem, at, 0.0))
                if excess > _BENT * away * away:
                    break
                away *= _FARTHER
    return points
