"""What a fit says of its unknowns and of itself."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.fits.answer.ranges import WITHIN
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.multistart import Optimum
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.information import Information

__all__ = ["FALSE_ALARM", "describe", "entry", "fit_report"]

Array = NDArray[np.float64]

FALSE_ALARM = 1e-3
_IDENTIFIED, _WEAK = 0.1, 1.0
_CROSSTALK = (3, 4)


def _typical_light(problem: FitProblem, x: Array) -> float:
    """Median modulus of the readings net of crosstalk, in the problem's unit."""
    net = problem.frames[:, :2] - problem.values(x)[3:5]
    return float(np.median(np.abs(net).max(axis=1)))


def describe(
    problem: FitProblem,
    top: Optimum,
    facts: Information,
    wider: float = 1.0,
    undecided: Sequence[Optimum] = (),
) -> dict[str, Any]:
    """Return value, standard deviation and status of every unknown.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Optimum
        Its best optimum.
    facts : Information
        There.
    wider : float
        Factor on all standard deviations (`widening`).
    undecided : sequence of Optimum
        Other values that are not decided against: standard deviations are widened until such
        values lie as far out as their deviance says, or in the interval of 95 % if that reaches
        them.

    Returns
    -------
    dict
        By scene path: ``value`` and ``sd`` (Cramer-Rao bound, ranges eliminated, times ``wider``,
        or what ``undecided`` asks for) in SI or reading units, and ``status``: identified (sd
        below a tenth), weak, not_identified (above 1), of the logarithm of what is positive, of
        crosstalk against the light of the scene.
    """
    functionals = problem.chain(top.x)[problem.slots] * problem.units[:, None]
    sds = wider * facts.sd_of(functionals)
    values = problem.natural(top.x)
    relative = wider * facts.sd
    for other in undecided:
        reach = math.sqrt(max(other.deviance - top.deviance, WITHIN))
        with np.errstate(over="ignore", invalid="ignore"):
            sds = np.fmax(sds, np.abs(problem.natural(other.x) - values) / reach)
            relative = np.fmax(relative, np.abs(other.x - top.x) / reach)
    light = max(_typical_light(problem, top.x), 1e-300)
    relative = relative / np.where(np.isin(problem.slots, _CROSSTALK), light, 1.0)
    found: dict[str, Any] = {}
    for name, value, sd, size in zip(problem.names, values, sds, relative, strict=True):
        found[name] = entry(float(value), float(sd), float(size))
    return found


def entry(value: float, sd: float, relative: float) -> dict[str, Any]:
    """Return ``value``, ``sd`` and ``status`` of an unknown that was fitted.

    Parameters
    ----------
    value, sd : float
        In SI or reading units; None in their place where they are not finite.
    relative : float
        Standard deviation of its logarithm, or of crosstalk against the light of the scene.
    """
    status = "identified" if relative < _IDENTIFIED else "weak"
    return {
        "value": value if math.isfinite(value) else None,
        "sd": sd if math.isfinite(sd) else None,
        "status": status if relative < _WEAK else "not_identified",
    }


def fit_report(
    problem: FitProblem, optima: Sequence[Optimum], facts: Information, wider: float
) -> dict[str, Any]:
    """Return how well a fit explains the frames.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    optima : sequence of Optimum
        Distinct ones, the best first.
    facts : Information
        At the best.
    wider : float
        Factor on all standard deviations (`widening`).

    Returns
    -------
    dict
        ``chi_square``, ``deviance``, ``degrees_of_freedom``, ``p_value``, ``misfit``, ``rank``,
        ``widening`` and ``optima``, each with its deviance above the best and its values.
    """
    residual, _ = residuals_and_information(problem, optima[0].x, optima[0].positions)
    chi_square = float(np.einsum("ni,ni->", residual, residual))
    freedom = 2 * problem.present.size - int(problem.present.sum()) - len(problem)
    p_value = float(special.chdtrc(freedom, chi_square))
    return {
        "chi_square": chi_square,
        "deviance": optima[0].deviance,
        "degrees_of_freedom": freedom,
        "p_value": p_value,
        "misfit": p_value < FALSE_ALARM,
        "rank": facts.rank,
        "widening": wider,
        "optima": [
            {
                "excess_deviance": optimum.deviance - optima[0].deviance,
                "parameters": {
                    name: value if math.isfinite(value) else None
                    for name, value in zip(
                        problem.names, problem.natural(optimum.x).tolist(), strict=True
                    )
                },
            }
            for optimum in optima
        ],
    }
