"""From a linear fit to a result: parameters, fit report, ranges that all frames agree upon."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.ranges import Answer, frame_ranges
from inference.fits.answer.report import FALSE_ALARM, entries
from inference.fits.likelihood.problem import fit_problem
from inference.fits.linear.least_squares import LinearFit
from inference.realtime.net import SATURATED, rule_out
from inference.technique import Task
from simulator.errors import RefusedError
from simulator.parameters import parameters_of

__all__ = ["linear_answer", "not_identified", "without_warnings"]

Array = NDArray[np.float64]


def not_identified(reason: str) -> dict[str, Any]:
    """Return the entry of a parameter of which the frames say nothing."""
    return {"value": None, "sd": None, "status": "not_identified", "reason": reason}


def without_warnings(
    solve: Callable[[Task], TechniqueResult],
) -> Callable[[Task], TechniqueResult]:
    """Wrap a solver so that overflow shows in its numbers, which `linear_answer` judges.

    Parameters
    ----------
    solve : callable
        Task -> TechniqueResult.
    """

    @functools.wraps(solve)
    def quiet(task: Task) -> TechniqueResult:
        with np.errstate(all="ignore"):
            return solve(task)

    return quiet


def linear_answer(
    name: str,
    task: Task,
    fit: LinearFit,
    natural: dict[str, tuple[float, Array]],
    single: TechniqueResult,
    missing: dict[str, str],
) -> TechniqueResult:
    """Build the result of a linear technique.

    Parameters
    ----------
    name : str
        The technique.
    task : Task
        The request.
    fit : LinearFit
        The fit.
    natural : dict
        By scene path: value, and gradient along the fit's coordinates.
    single : TechniqueResult
        Ranges of single frames; they stand where a parameter is not identified.
    missing : dict
        Scene paths that are not identified, with the reason.

    Returns
    -------
    TechniqueResult
        Ranges by all readings and parameters together where every parameter is identified.
    """
    numbers = [fit.chi_square, *(value for value, _ in natural.values())]
    if not np.isfinite(numbers).all():
        raise RefusedError(
            "the fit overflows: the readings are too large or too small against gain and noise, or "
            "do not follow the object's law; check them"
        )
    sds = {path: float(np.linalg.norm(slope @ fit.factor)) for path, (_, slope) in natural.items()}
    found = {
        path: (float(value), sds[path], float(np.divide(sds[path], abs(value))))
        for path, (value, _) in natural.items()
    }
    parameters = entries(parameters_of(task.sensor, task.scene), found)
    parameters |= {path: not_identified(reason) for path, reason in missing.items()}
    freedom = fit.residuals.size - fit.x.size
    p_value = float(scipy.special.chdtrc(freedom, fit.chi_square))
    report = {
        "chi_square": fit.chi_square,
        "degrees_of_freedom": freedom,
        "p_value": p_value,
        "misfit": p_value < FALSE_ALARM,
        "rank": fit.rank,
        "optima": [],
    }
    if missing:
        return TechniqueResult(
            technique=name,
            status=single.status,
            roots_m=single.roots_m,
            roots_sd_m=single.roots_sd_m,
            root_count=single.root_count,
            near_fold=single.near_fold,
            reason=single.reason,
            reasons=single.reasons,
            parameters=parameters,
            fit=report,
        )
    report["optima"] = [
        {
            "excess_deviance": 0.0,
            "parameters": {path: float(value) for path, (value, _) in natural.items()},
        }
    ]
    state = rule_out(task.sensor, task.frames)
    problem = fit_problem(task.sensor, task.scene, task.frames.select(state != SATURATED))
    values = np.array([natural[path][0] for path in problem.names])
    gradients = np.array([natural[path][1] for path in problem.names])
    x = problem.coordinates(values[None])[0]
    if not np.isfinite(x).all():
        raise RefusedError("the best fit is no object: a size or reflectance is not positive")
    along = problem.chain(x)[problem.slots] * problem.units[:, None]
    factor = np.asarray(np.linalg.solve(along, gradients @ fit.factor), dtype=np.float64)
    return frame_ranges(name, problem, [Answer(x, 0.0, factor)], state, parameters, report)
