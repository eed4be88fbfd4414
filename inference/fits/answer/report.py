"""What a fit says of its unknowns and of itself."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.answer.model_checks import REASONS, Check
from inference.fits.answer.ranges import WITHIN
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.information import Information
from inference.identifiability.status import is_positive, spread_of_fit, status_of
from simulator.parameters import Parameters

Array = NDArray[np.float64]

__all__ = [
    "FALSE_ALARM",
    "describe",
    "disputed",
    "doubt_of",
    "entries",
    "fit_report",
    "p_value_of",
    "spoiled",
    "with_parts",
]


FALSE_ALARM = 1e-3
DOUBTFUL = 0.05  # of healthy fits whose noise is doubted
_TO_END = 1.645  # standard deviations to an end of a 90 % interval
_FARTHEST = 20.0  # of a logarithm
_ONE = 1.0 - 1e-12  # for 1, whose logarithm of what is left is no number


def describe(
    problem: FitProblem,
    top: Maximum,
    facts: Information,
    wider: float = 1.0,
    undecided: Sequence[Maximum] = (),
    whole: Information | None = None,
    maxima: Sequence[Erring] = (),
) -> dict[str, Any]:
    """Return value, standard deviation and status of every unknown.

    Parameters
    ----------
    wider : float
        Factor on all standard deviations (`inflation`).
    undecided : sequence of Maximum
        Other values that are not decided against: standard deviations are widened until such
        values lie as far out as their deviance says, or in the interval of 95 % if that reaches
        them.
    whole : Information, optional
        What is told if the errors of the model are unknown; left out: it has none.
    maxima : sequence of Erring
        Further ones, whose own widths count besides, as far as their deviances let them.

    Returns
    -------
    dict
        As `entries`, with ``sd_parts``; ``sd`` is the Cramer-Rao bound, ranges eliminated, times
        ``wider``, together with the model's part, or what ``undecided`` asks for.
    """
    functionals = problem.chain(top.x)[problem.slots] * problem.units[:, None]
    sds = wider * facts.sd_of(functionals)
    values = problem.natural(top.x)
    model = np.zeros_like(sds)
    if whole is not None:
        all_errors = np.square(wider * whole.sd_of(functionals))
        model = np.sqrt(np.maximum(all_errors - np.square(sds), 0.0))
        sds = np.hypot(sds, model)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        ratios = sds / np.abs(values)
        sds = np.fmax(sds, _farther_sides(problem, top, whole or facts, functionals, sds))
        others = [*((one, None) for one in undecided), *((end, end.whole) for end in maxima)]
        for other, told in others:
            excess = other.deviance - top.deviance
            reach, there = math.sqrt(max(excess, WITHIN)), problem.natural(other.x)
            own_width = np.zeros_like(sds)
            if told is not None:
                chain = problem.chain(other.x)[problem.slots] * problem.units[:, None]
                left = math.sqrt(max(WITHIN - excess, 0.0))
                own_width = left * wider * told.sd_of(chain)
            sds = np.fmax(sds, (np.abs(there - values) + own_width) / reach)
            moved = np.abs(np.log(there / values)) + own_width / np.abs(there)
            ratios = np.fmax(ratios, moved / reach)
        # the others known, a coordinate is as certain as its own column is long
        own = np.abs(np.diag(functionals)) / np.linalg.norm(facts.jacobian, axis=0)
    columns = zip(values.tolist(), sds.tolist(), ratios.tolist(), strict=True)
    found = entries(problem.parameters, dict(zip(problem.names, columns, strict=True)))
    parts = zip(own.tolist(), model.tolist(), strict=True)
    return with_parts(found, dict(zip(problem.names, parts, strict=True)))


def _farther_sides(
    problem: FitProblem, top: Maximum, told: Information, functionals: Array, sds: Array
) -> Array:
    """Return standard deviations whose 90 % interval reaches to the farther of both its ends.

    Coordinates are as good as normal, not values: a size that is told to a factor may be larger by
    more than it may be smaller. So every unknown is moved to both ends of its interval, all others
    following, and the way of its value counts.
    """
    covariances = told.factor @ (told.factor.T @ functionals.T)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        variances = np.einsum("jd,dj->j", functionals, covariances)
        ways = (covariances * (sds / variances)).T
        farther = np.zeros_like(sds)
        for j in np.flatnonzero(np.isfinite(ways).all(axis=1)).tolist():
            for sign in (_TO_END, -_TO_END):
                way = sign * ways[j]
                way[problem.logarithms] = np.clip(way[problem.logarithms], -_FARTHEST, _FARTHEST)
                end = problem.natural(np.clip(top.x + way, *problem.bounds(top.x)))
                away = abs(end[j] - problem.natural(top.x)[j]) / _TO_END
                farther[j] = max(farther[j], away if math.isfinite(away) else 0.0)
    return farther


def disputed(
    parameters: Mapping[str, Any], alone: Mapping[str, Any], others: Mapping[str, Sequence[float]]
) -> dict[str, Any]:
    """Return parameters of which none is `identified` where several optima disagree.

    Parameters
    ----------
    parameters, alone : mapping
        From `describe`, with and without other optima.
    others : mapping of str to sequence of float
        By scene path, values at other optima that are not decided against.

    Returns
    -------
    dict
        As ``parameters``; `weak` at best what lies at another optimum by more than a standard
        deviation elsewhere.
    """
    answer: dict[str, Any] = {}
    for path, entry in parameters.items():
        value, sd = alone[path]["value"], alone[path]["sd"]
        agreed = value is not None and sd is not None
        agreed = agreed and all(abs(other - value) <= sd for other in others.get(path, ()))
        weak = entry["status"] == "identified" and not agreed
        answer[path] = {**entry, "status": "weak"} if weak else dict(entry)
    return answer


def with_parts(
    parameters: Mapping[str, Any], parts: Mapping[str, tuple[float, float]]
) -> dict[str, Any]:
    """Return parameters with their error budget, ``sd_parts``.

    Parameters
    ----------
    parameters : mapping
        As `entries`.
    parts : mapping of str to (float, float)
        By scene path, the parts of noise with all others known, and of the model; what is left of
        the whole is the scene's.
    """
    answer: dict[str, Any] = {}
    for path, entry in parameters.items():
        sd, (noise, model) = entry["sd"], parts[path]
        budget = None
        if sd is not None:
            model = min(model, sd)
            noise = min(noise, math.sqrt(sd * sd - model * model))
            scene = math.sqrt(max(sd * sd - noise * noise - model * model, 0.0))
            budget = {"noise": noise, "scene": scene, "model": model}
        answer[path] = {**entry, "sd_parts": budget}
    return answer


def spoiled(parameters: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a misfit leaves of a fit's parameters.

    Parameters
    ----------
    parameters : mapping
        From `describe`, or of a linear fit.
    report : mapping
        From `fit_report`, or of a linear fit: standard deviations grow with the root of chi-square
        over its degrees of freedom.

    Returns
    -------
    dict
        As `entries`; nothing is identified by a model that does not explain the frames.
    """
    factor = math.sqrt(max(report["chi_square"] / max(report["degrees_of_freedom"], 1), 1.0))
    answer = {}
    for path, entry in parameters.items():
        # what is not identified anyway has no parts
        sd, parts = entry["sd"], entry.get("sd_parts")
        answer[path] = {
            **entry,
            "sd": None if sd is None else factor * sd,
            "status": "not_identified",
            "sd_parts": parts and {name: factor * part for name, part in parts.items()},
        }
    return answer


def entries(
    parameters: Parameters, found: Mapping[str, tuple[float, float, float]]
) -> dict[str, Any]:
    """Return value, standard deviation and status of unknowns that were fitted.

    Of an exact model the fit uses no prior, as a rule, but `inference.identifiability.status`
    tells by how much it would narrow the prior that the scene states, or that is its default:
    identified where what is left is less than 0.2 of the prior's standard deviation, weak up to
    0.7, not_identified beyond.

    Parameters
    ----------
    parameters : Parameters
        The unknowns of the scene with their priors.
    found : mapping of str to (float, float, float)
        By scene path, value and standard deviation in SI or reading units, and the standard
        deviation of the logarithm, which is read of what can only be positive.

    Returns
    -------
    dict
        By scene path ``value``, ``sd`` (None in their place where they are not finite) and
        ``status``.
    """
    values = {path: value for path, (value, _, _) in found.items()}
    answer: dict[str, Any] = {}
    for path, (value, sd, ratio) in found.items():
        own = ratio * value if is_positive(path) else sd
        answer[path] = {
            "value": value if math.isfinite(value) else None,
            "sd": sd if math.isfinite(sd) else None,
            "status": status_of(path, spread_of_fit(parameters, path, values, own)),
        }
    return answer


def _freedom(problem: FitProblem) -> int:
    told = 0 if problem.known is None else problem.known.numbers
    # what a joint law knows of the unknowns is held against the frames as they are
    free = 0 if problem.law else len(problem)
    return 2 * problem.present.size - int(problem.present.sum()) - free + told


def doubt_of(problem: FitProblem, chi_square: float) -> float:
    """Return by what the variance of noise may be larger than stated, where chi-square doubts it.

    Parameters
    ----------
    problem : FitProblem
        Every frame is one term, of as many readings as it has.
    chi_square : float
        Of the best fit.

    Returns
    -------
    float
        Chi-square over its degrees of freedom (Birge 1932) where so large a one comes by chance in
        less than one fit in twenty; 1 elsewhere, and where it is a misfit, which says so
        (docs/model.md, doubt).
    """
    p_value = p_value_of(problem, chi_square)
    if not FALSE_ALARM <= p_value < DOUBTFUL:
        return 1.0
    return max(chi_square / max(_freedom(problem), 1), 1.0)


def p_value_of(problem: FitProblem, chi_square: float) -> float:
    """Return how often noise alone makes a chi-square of a fit greater."""
    return float(scipy.special.chdtrc(_freedom(problem), chi_square))


def fit_report(
    problem: FitProblem,
    optima: Sequence[Maximum],
    chi_square: float,
    rank: int,
    wider: float,
    checks: Mapping[str, Check] = MappingProxyType({}),
) -> dict[str, Any]:
    """Return how well a fit explains the frames.

    Parameters
    ----------
    optima : sequence of Maximum
        Distinct ones, the best first.
    chi_square : float
        At the best, less what errors of the model take up.
    rank : int
        Directions of the unknowns that the frames tell.
    wider : float
        Factor on all standard deviations (`inflation`).
    checks : mapping of str to Check
        Others than that of chi-square (`model_checks`).

    Returns
    -------
    dict
        ``chi_square`` less what errors of the model take up, ``deviance``, ``degrees_of_freedom``,
        ``p_value`` of the worst of all checks, made up for their number as if they were independent
        (Sidak), ``misfit`` and its ``reasons``, ``checks`` with the p-value of each, ``by_priors``:
        whether those of the unknowns count, ``rank``, ``widening`` and ``optima``, each with its
        deviance above the first, as they have it, and its values.
    """
    each = {"chi_square": p_value_of(problem, chi_square)}
    each |= {name: check.p_value for name, check in checks.items()}
    together = {
        name: -math.expm1(len(each) * math.log1p(-min(p, _ONE))) for name, p in each.items()
    }
    p_value = min(together.values())
    return {
        "chi_square": chi_square,
        "deviance": optima[0].deviance,
        "degrees_of_freedom": _freedom(problem),
        "p_value": p_value,
        "misfit": p_value < FALSE_ALARM,
        "reasons": [REASONS[name] for name, p in together.items() if p < FALSE_ALARM],
        "checks": each,
        "by_priors": problem.erring,
        "rank": rank,
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
