"""From a linear fit to a result: parameters, fit report, ranges that all frames agree upon."""

import dataclasses
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.model_checks import REASONS
from inference.fits.answer.ranges import MISFIT, Answer, frame_ranges
from inference.fits.answer.report import FALSE_ALARM, entries, spoiled, with_parts
from inference.fits.answer.withheld import without_ranges
from inference.fits.likelihood.model_error import unexplained
from inference.fits.likelihood.problem import fit_problem
from inference.fits.linear.follow import Follow
from inference.fits.linear.least_squares import LinearFit
from inference.realtime.net import SATURATED, rule_out
from inference.technique import Task
from simulator.errors import RefusedError
from simulator.parameters import parameters_of

__all__ = ["linear_answer", "not_identified"]

Array = NDArray[np.float64]


def not_identified(reason: str) -> dict[str, Any]:
    """Return the entry of a parameter of which the frames say nothing."""
    return {"value": None, "sd": None, "status": "not_identified", "reason": reason}


def linear_answer(
    name: str,
    task: Task,
    fit: LinearFit,
    natural: dict[str, tuple[float, Array]],
    single: TechniqueResult,
    missing: dict[str, str],
    follow: Follow,
) -> TechniqueResult:
    """Build the result of a linear technique.

    Parameters
    ----------
    name : str
        The technique.
    natural : dict
        By scene path: value, and gradient along the fit's coordinates.
    single : TechniqueResult
        Ranges of single frames; they stand where a parameter is not identified.
    missing : dict
        Scene paths that are not identified, with the reason.
    follow : Follow
        The fit, to be asked what errors of the model do.

    Returns
    -------
    TechniqueResult
        Ranges by all readings and parameters together where every parameter is identified; none
        of a fit that does not explain the frames.
    """
    numbers = [fit.chi_square, *(value for value, _ in natural.values())]
    if not np.isfinite(numbers).all():
        raise RefusedError(
            "the fit overflows: the readings are too large or too small against gain and noise, or "
            "do not follow the object's law; check them"
        )
    slopes = np.array([slope for _, slope in natural.values()])
    spread = slopes.reshape(len(natural), fit.x.size) @ fit.factor
    changes, of_residuals, share = follow.changes(task)
    model = np.linalg.norm(changes, axis=1)
    sds = np.hypot(np.linalg.norm(spread, axis=1), model).tolist()
    found = {
        path: (float(value), sd, float(np.divide(sd, abs(value))))
        for (path, (value, _)), sd in zip(natural.items(), sds, strict=True)
    }
    own = 1.0 / np.linalg.norm(np.linalg.pinv(spread), axis=0)
    parts = dict(zip(natural, zip(own.tolist(), model.tolist(), strict=True), strict=True))
    parameters = with_parts(entries(parameters_of(task.sensor, task.scene), found), parts)
    parameters |= {path: not_identified(reason) for path, reason in missing.items()}
    freedom = fit.residuals.size - fit.x.size
    chi_square = fit.chi_square
    if of_residuals.size:
        chi_square = unexplained(fit.residuals, of_residuals, share, fit.light)
    p_value = float(scipy.special.chdtrc(freedom, chi_square))
    report = {
        "chi_square": chi_square,
        "degrees_of_freedom": freedom,
        "p_value": p_value,
        "misfit": p_value < FALSE_ALARM,
        "reasons": [REASONS["chi_square"]] if p_value < FALSE_ALARM else [],
        "checks": {"chi_square": p_value},
        "rank": fit.rank,
        "optima": [],
    }
    if report["misfit"]:
        parameters = spoiled(parameters, report)
    if missing:
        stands = without_ranges(single, MISFIT) if report["misfit"] else single
        return dataclasses.replace(stands, technique=name, parameters=parameters, fit=report)
    report["optima"] = [
        {
            "excess_deviance": 0.0,
            "parameters": {path: float(value) for path, (value, _) in natural.items()},
        }
    ]
    state = rule_out(task.sensor, task.frames)
    frames = task.frames.select(state != SATURATED)
    problem = fit_problem(task.sensor, task.scene, frames, exact=task.exact)
    values = np.array([natural[path][0] for path in problem.names])
    gradients = np.array([natural[path][1] for path in problem.names])
    x = problem.coordinates(values[None])[0]
    if not np.isfinite(x).all():
        raise RefusedError("the best fit is no object: a size or reflectance is not positive")
    along = problem.chain(x)[problem.slots] * problem.units[:, None]
    inverse = np.linalg.inv(along)
    answer = Answer(x, 0.0, inverse @ gradients @ fit.factor, inverse @ changes)
    return frame_ranges(name, problem, [answer], state, parameters, report)
