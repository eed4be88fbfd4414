"""Values of the unknowns far from an optimum that explain the frames nearly as well.

Where little is told apart, the likelihood has optima side by side, some of them sharp (a pole of
the flux just outside the ranges seen), and long valleys with no optimum at all: neither curvature
nor a walk from the best optimum sees the others. Here every unknown is held at values spread over
its prior, wherever the best optimum lies, and everything else is fitted anew.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.answer.inflation import BETTER, loosely_told
from inference.fits.likelihood.conditional_fit import conditional, unconditional
from inference.fits.likelihood.maximum import Maximum, approach, maximum_from
from inference.fits.likelihood.multistart import BREADTH
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.information import Information

__all__ = ["profile_scan"]

Array = NDArray[np.float64]

_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
_STEPS = 50


def profile_scan(
    problem: FitProblem, top: Maximum, facts: Information, *, always: bool = False
) -> tuple[list[Maximum], Maximum | None]:
    """Fit with each unknown held at values far from the best optimum.

    Parameters
    ----------
    facts : Information
        There, of full rank.
    always : bool
        Also where the unknowns seem to be told well.

    Returns
    -------
    (list of Maximum, Maximum or None)
        Points of the whole problem, optimal but for one unknown each; and a better optimum, if one
        was met.
    """
    found: list[Maximum] = []
    if len(problem) < 2 or not (always or loosely_told(problem, facts)):
        return found, None
    for j in np.flatnonzero(problem.logarithms).tolist():
        for value in _spread_over_prior(problem, j):
            x = top.x.copy()
            x[j] = value
            smaller, rest = conditional(problem, j, x)
            there = approach(smaller, rest, _STEPS)
            excess = there.deviance - top.deviance
            if not np.isfinite(excess):
                continue
            whole = unconditional(problem, smaller, there.x)
            if excess < -BETTER:
                better = maximum_from(problem, whole)
                if better.deviance < top.deviance:
                    return found, better
            found.append(Maximum(whole, there.deviance, there.remaining, there.positions))
    return found, None


def _spread_over_prior(problem: FitProblem, j: int) -> Array:
    """Coordinates of one unknown at quantiles of its prior, those outside of the bounds left out.

    The prior is taken as broad as the starting points of the fit are.
    """
    names = problem.parameters.names
    z = np.zeros((len(_QUANTILES), len(names)))
    z[:, names.index(problem.names[j])] = BREADTH * scipy.special.ndtri(_QUANTILES)
    columns = [names.index(name) for name in problem.names]
    values = problem.coordinates(problem.parameters.natural(z)[:, columns])[:, j]
    return np.asarray(values[np.isfinite(values)])
