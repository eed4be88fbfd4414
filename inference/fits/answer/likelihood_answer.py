"""From optima of the likelihood of all frames to a result, or to a refusal."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.blamed import blamed
from inference.fits.answer.determined import (
    LeftOpenError,
    noise_may_be_followed,
    off_the_top,
    refuse_if_noise_was_followed,
    refuse_if_open,
    refuse_if_undetermined,
    tells_nothing,
)
from inference.fits.answer.inflation import inflation, shift_of
from inference.fits.answer.larger_error import DOUBLINGS, evidence_of, is_default, twice_as_large
from inference.fits.answer.model_checks import model_checks
from inference.fits.answer.profile_scan import profile_scan
from inference.fits.answer.ranges import (
    CONTRADICTION,
    WITHIN,
    Answer,
    Beside,
    beside,
    frame_ranges,
)
from inference.fits.answer.report import (
    DOUBTFUL,
    FALSE_ALARM,
    describe,
    disputed,
    doubt_of,
    fit_report,
    p_value_of,
    spoiled,
)
from inference.fits.likelihood.erring import Erring, contradicting, erring_maxima, softened
from inference.fits.likelihood.erring_profile import profiles
from inference.fits.likelihood.erring_valley import valleys
from inference.fits.likelihood.held_walks import held_walks
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.integrated import with_integrated_first
from inference.fits.likelihood.law_mode import law_modes
from inference.fits.likelihood.maximum import DECIDED, TOP, Maximum, maximum_from
from inference.fits.likelihood.multistart import find_maxima, find_near, find_starts
from inference.fits.likelihood.places import places_of
from inference.fits.likelihood.prior_maxima import prior_maxima
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.range_walks import range_walks
from inference.fits.likelihood.told import known_ranges
from inference.realtime.net import SATURATED, rule_out
from inference.technique import Task
from simulator.errors import RefusedError
from simulator.one_thread import one_thread

__all__ = ["likelihood_answer"]

_WALKS = 3  # that may meet a better optimum than the last
_NO_LIKELIHOOD = (
    "no values of the unknowns give the readings a likelihood that can be computed; check gain, "
    "noise and range_m"
)


@one_thread()
def likelihood_answer(
    name: str, task: Task, values: dict[str, float] | None = None
) -> TechniqueResult:
    """Fit everything unknown by the likelihood of all frames.

    Parameters
    ----------
    name : str
        The technique.
    values : dict, optional
        By scene path, all that is unknown besides the ranges, as another fit has found it: where
        the climb begins. Left out: optima are looked for everywhere.

    Returns
    -------
    TechniqueResult
        Without run time.

    Raises
    ------
    RefusedError
        Where the frames do not determine what is unknown; and where the values are no object.
    """
    state = rule_out(task.sensor, task.frames)
    frames = task.frames.select(state != SATURATED)
    problem = fit_problem(task.sensor, task.scene, frames, exact=task.exact)
    if not task.exact:
        law = problem.parameters.law is not None
        known = known_ranges(frames, problem.support)
        places = None
        if problem.object_errs:  # an exact model leaves nothing for them to share
            places = places_of(problem.frames, problem.present, problem.instrument)
        problem = dataclasses.replace(problem, law=law, known=known, places=places)
    found = _found(problem) if values is None else _found_from(problem, values)
    optima = [optimum for optimum in found if np.isfinite(optimum.deviance)]
    if not optima:
        raise RefusedError(_NO_LIKELIHOOD)
    if problem.erring:
        return _erring_answer(name, problem, optima, state)
    try:
        return _exact_answer(name, problem, optima, state)
    except LeftOpenError:
        if task.exact or values is not None:  # asked for what the frames alone say
            raise
        problem = dataclasses.replace(problem, priors=True)
        answer = _erring_answer(name, problem, [*optima, *find_near(problem)], state)
        if tells_nothing(answer, state):
            raise
        return answer


def _found(problem: FitProblem) -> Sequence[Maximum]:
    """Return optima, the best first; points near them where the model errs."""
    if problem.erring:
        return find_starts(problem, softened(problem))
    found = find_maxima(problem)
    if not found or _explains(problem, found[0]):
        return found
    # walls between optima grow with the square of the readings over their noise
    near = find_starts(problem, softened(problem))
    climbed = [maximum_from(problem, start.x) for start in near]
    best = min([found[0], *climbed], key=lambda optimum: optimum.deviance)
    return (best, *found) if best.deviance < found[0].deviance - TOP else found


def _explains(problem: FitProblem, top: Maximum) -> bool:
    residual, _ = residuals_and_information(problem, top.x, top.positions)
    return not _unlike(problem, float(np.square(residual).sum()))


def _unlike(problem: FitProblem, chi_square: float) -> bool:
    """Return whether noise alone makes no such chi-square, of frames that the model explains."""
    return p_value_of(problem, max(chi_square, 0.0)) < FALSE_ALARM


def _found_from(problem: FitProblem, values: dict[str, float]) -> list[Maximum]:
    """Return ends of climbs from given values."""
    x = problem.coordinates(np.array([[values[path] for path in problem.names]]))[0]
    if not np.isfinite(x).all():
        raise RefusedError("the best fit is no object: a size or reflectance is not positive")
    climbed = (*softened(problem), problem) if problem.erring else (problem,)
    return [maximum_from(one, x) for one in climbed]


def _exact_answer(
    name: str, problem: FitProblem, optima: list[Maximum], state: NDArray[np.uint8]
) -> TechniqueResult:
    """Build the result where the model is exact."""
    scanned: list[Maximum] = []
    walked: list[Maximum] = []
    for walk in range(_WALKS + 1):
        top = optima[0]
        _, facts = residuals_and_information(problem, top.x, top.positions)
        refuse_if_undetermined(problem, top, facts)
        wider, walked, better = inflation(problem, top, facts)
        if better is None:
            doubtful = noise_may_be_followed(problem, top)
            scanned, better = profile_scan(problem, top, facts, always=doubtful)
        if better is None or walk == _WALKS:
            break
        # the old one lies in the same valley, on the way to this
        optima[0] = better
        optima = [one for one in optima if one.deviance >= better.deviance]
    if noise_may_be_followed(problem, top):
        if not scanned:  # a better optimum was met on every walk
            scanned, _ = profile_scan(problem, top, facts, always=True)
        refuse_if_noise_was_followed(problem, top, scanned)
    residual, facts = residuals_and_information(problem, top.x, top.positions)
    chi_square = float(np.square(residual).sum())
    wider = math.hypot(wider, off_the_top(top, _unlike(problem, chi_square - top.remaining)))
    doubt = doubt_of(problem, chi_square)

    def with_excess(found: Sequence[Maximum]) -> list[tuple[float, Maximum]]:
        return [((one.deviance - top.deviance) / doubt, one) for one in found]

    points = [(excess, one) for excess, one in with_excess(scanned) if excess <= DECIDED]
    for excess, point in points:
        reach = math.sqrt(doubt * max(excess, WITHIN))
        wider = max(wider, shift_of(problem, top, facts, point) / reach)
    best = Answer(top.x, 0.0, wider * facts.factor)
    wider *= math.sqrt(doubt)
    others = with_excess(optima[1:])
    refuse_if_open(problem, top, facts, wider, others)
    near = [(excess, one) for excess, one in others if excess <= DECIDED]
    undecided = [Answer(one.x, one.deviance - top.deviance) for _, one in near]
    report = fit_report(problem, optima, chi_square, facts.rank, wider)
    parameters = describe(problem, top, facts, wider, [one for _, one in (*near, *points)])
    points += [(excess, one) for excess, one in with_excess(walked) if excess <= DECIDED]
    # walks go where no prior would let an unknown be: they count against what claims to be told
    walked_too = describe(problem, top, facts, wider, [one for _, one in (*near, *points)])
    parameters = {
        path: walked_too[path] if entry["status"] == "identified" else entry
        for path, entry in parameters.items()
    }
    return frame_ranges(
        name,
        problem,
        [best, *undecided],
        state,
        spoiled(parameters, report) if report["misfit"] else parameters,
        report,
        [Beside(excess, one.positions) for excess, one in points],
        doubt=doubt,
    )


def _believed(
    problem: FitProblem, starts: Sequence[Maximum]
) -> tuple[FitProblem, list[Erring], list[Erring]]:
    """Return the problem, with a larger error of the model where the frames ask, and its maxima."""
    found, along = _searched(problem, starts)
    if not is_default(problem) or not FALSE_ALARM <= _probability(problem, found[0]) < DOUBTFUL:
        return problem, found, along
    for _ in range(DOUBLINGS):
        larger = twice_as_large(problem)
        more, beside = _searched(larger, [*starts, *found])
        if not evidence_of(more[0]) > evidence_of(found[0]):
            break
        problem, found, along = larger, more, beside
    return problem, found, along


def _probability(problem: FitProblem, top: Erring) -> float:
    """Return the p-value of a best fit, by all its checks."""
    checks = model_checks(problem, top)
    p_value = fit_report(problem, [top], top.chi_square, 0, 1.0, checks)["p_value"]
    return float(p_value)


def _searched(problem: FitProblem, starts: Sequence[Maximum]) -> tuple[list[Erring], list[Erring]]:
    """Return the maxima, the best first, and points along their valleys."""
    modes = law_modes(problem.parameters.law) if problem.law else (None,)
    climb, follow = (prior_maxima, range_walks) if problem.priors else (erring_maxima, valleys)
    found = [
        end for mode in modes for end in climb(dataclasses.replace(problem, mode=mode), starts)
    ]
    if not found:
        raise RefusedError(_NO_LIKELIHOOD)
    found.sort(key=lambda end: end.deviance)
    along: list[Erring] = []
    for _ in range(_WALKS):
        mode = found[0].clean.mode
        alike = [one for one in found if one.clean.mode is mode]
        alone = dataclasses.replace(problem, mode=mode)
        along, better = follow(alone, alike)
        if better is None and not problem.priors:
            along += profiles(alone, found[0])
        if better is None or not better.deviance < found[0].deviance:
            break
        found.insert(0, better)
    if problem.priors:
        return with_integrated_first(found, along)
    return found, along


def _alone(one: Erring, excess: float) -> Beside:
    """Return other values without noise: what errs has no frame as sure as that."""
    return Beside(excess, one.positions)


def _erring_answer(
    name: str, problem: FitProblem, starts: Sequence[Maximum], state: NDArray[np.uint8]
) -> TechniqueResult:
    """Build the result where the model errs."""
    problem, found, along = _believed(problem, starts)
    top = found[0]
    _, facts = residuals_and_information(top.clean, top.x, top.positions)
    if not problem.law and problem.known is None:
        refuse_if_undetermined(top.clean, top, facts)
    contradicted = contradicting(top, problem)
    wider, doubt = 1.0, doubt_of(problem, top.chi_square)
    # of readings that the model cannot make, whatever a last step would gain, that is to be said
    if not contradicted and not _unlike(problem, top.chi_square - top.remaining):
        wider = math.hypot(1.0, off_the_top(top))
        refuse_if_open(top.clean, top, top.facts, wider * math.sqrt(doubt), whole=top.whole)
    decided = top.deviance + doubt * DECIDED
    near = [one for one in (*found[1:], *along) if one.deviance <= decided]
    # another mode of the law is another answer; near in the same mode, a wider one
    others = {id(one.clean.mode): one for one in reversed(near) if one.clean.mode is not None}
    others.pop(id(top.clean.mode), None)
    checks = model_checks(problem, top)
    widening = wider * math.sqrt(doubt)
    report = fit_report(problem, found, top.chi_square, facts.rank, widening, checks)
    if report["misfit"]:
        report["reasons"] += blamed(problem, top, np.flatnonzero(state != SATURATED))
    if contradicted:
        report["misfit"] = True
        report["reasons"].append(CONTRADICTION)
    parameters = describe(top.clean, top, top.facts, widening, near, top.whole)
    if problem.priors:
        told = [parameters[name]["status"] == "identified" for name in problem.names]
        near += held_walks(problem, top, np.flatnonzero(told).tolist())
        parameters = describe(top.clean, top, top.facts, widening, near, top.whole)
        alone = describe(top.clean, top, top.facts, widening, (), top.whole)
        places = [problem.natural(one.x) for one in found[1:] if one.deviance <= decided]
        elsewhere = {name: [x[j] for x in places] for j, name in enumerate(problem.names)}
        parameters = disputed(parameters, alone, elsewhere)
    return frame_ranges(
        name,
        problem,
        [
            Answer(one.x, one.deviance - top.deviance, erring=one, wider=wider)
            for one in (top, *others.values())
        ],
        state,
        spoiled(parameters, report) if report["misfit"] else parameters,
        report,
        [
            (beside if problem.priors else _alone)(one, (one.deviance - top.deviance) / doubt)
            for one in near
            if one.clean.mode is top.clean.mode
        ],
        contradicted,
        doubt,
    )
