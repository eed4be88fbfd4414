"""Values of the unknowns far from an optimum that explain the frames nearly as well.

Where little is told apart, the likelihood has optima side by side, some of them sharp (a pole of
the flux just outside the ranges seen), and long valleys with no optimum at all: neither curvature
nor a walk from the best optimum sees the others. Here every unknown is held at values spread over
its prior, wherever the best optimum lies, and everything else is fitted anew.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.fits.answer.inflation import BETTER, loosely_told
from inference.fits.answer.ranges import DECIDED
from inference.fits.likelihood.conditional_fit import held, released
from inference.fits.likelihood.multistart import BREADTH, Optimum, climb_from, optimum_from
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.information import Information

__all__ = ["elsewhere"]

Array = NDArray[np.float64]

_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
_STEPS = 50
_CROSSTALK = (3, 4)


def elsewhere(
    problem: FitProblem, top: Optimum, facts: Information
) -> tuple[list[Optimum], Optimum | None]:
    """Look for values far from the best optimum that are nearly as good.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Optimum
        Its best optimum.
    facts : Information
        There, of full rank.

    Returns
    -------
    (list of Optimum, Optimum or None)
        Points of the whole problem, optimal but for one unknown each, that are not decided
        against; and a better optimum, if one was met.
    """
    found: list[Optimum] = []
    if len(problem) < 2 or not loosely_told(problem, facts):
        return found, None
    for j in np.flatnonzero(~np.isin(problem.slots, _CROSSTALK)).tolist():
        for value in _spread_over_prior(problem, j):
            x = top.x.copy()
            x[j] = value
            smaller, rest = held(problem, j, x)
            there = climb_from(smaller, rest, _STEPS)
            excess = there.deviance - top.deviance
            if not excess <= DECIDED:
                continue
            whole = released(problem, smaller, there.x)
            if excess < -BETTER:
                better = optimum_from(problem, whole)
                if better.deviance < top.deviance:
                    return found, better
            found.append(Optimum(whole, there.deviance, there.remaining, there.positions))
    return found, None


def _spread_over_prior(problem: FitProblem, j: int) -> Array:
    """Coordinates of one unknown at quantiles of its prior, those outside of the bounds left out.

    The prior is taken as broad as the starting points of the fit are.
    """
    names = problem.parameters.names
    z = np.zeros((len(_QUANTILES), len(names)))
    z[:, names.index(problem.names[j])] = BREADTH * special.ndtri(_QUANTILES)
    columns = [names.index(name) for name in problem.names]
    values = problem.coordinates(problem.parameters.natural(z)[:, columns])[:, j]
    return np.asarray(values[np.isfinite(values)])
