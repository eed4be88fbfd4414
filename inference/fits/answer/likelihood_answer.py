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
from inference.fits.answer.erring_search import NO_LIKELIHOOD, believed, judged
from inference.fits.answer.inflation import inflation, shift_of
from inference.fits.answer.model_checks import free_of, model_checks
from inference.fits.answer.profile_scan import profile_scan
from inference.fits.answer.ranges import (
    CONTRADICTION,
    WITHIN,
    Answer,
    Beside,
    Elsewhere,
    beside,
    frame_ranges,
)
from inference.fits.answer.report import (
    FALSE_ALARM,
    describe,
    disputed,
    doubt_of,
    fit_report,
    p_value_of,
    spoiled,
)
from inference.fits.answer.rivals import rivals_of
from inference.fits.answer.smoothed import SCATTER
from inference.fits.answer.succession import scatters_less
from inference.fits.likelihood.erring import Erring, contradicting, softened
from inference.fits.likelihood.far_ends import far_ends
from inference.fits.likelihood.held_walks import held_walks
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.law_mode import law_modes, place_of
from inference.fits.likelihood.maximum import DECIDED, TOP, Maximum, maximum_from
from inference.fits.likelihood.multistart import find_maxima, find_near, find_starts
from inference.fits.likelihood.places import places_of
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.told import known_ranges
from inference.realtime.net import SATURATED, rule_out
from inference.technique import Task
from simulator.errors import RefusedError
from simulator.one_thread import one_thread

__all__ = ["likelihood_answer"]

_WALKS = 3  # that may meet a better optimum than the last


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
        modes = law_modes(task.scene, problem.parameters)
        problem = dataclasses.replace(problem, law=law, known=known, places=places, modes=modes)
    found = _found(problem) if values is None else _found_from(problem, values)
    optima = [optimum for optimum in found if np.isfinite(optimum.deviance)]
    if not optima:
        raise RefusedError(NO_LIKELIHOOD)
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
        Elsewhere([Beside(excess, one.positions) for excess, one in points]),
        doubt=doubt,
    )


def _alone(one: Erring, excess: float) -> Beside:
    """Return other values without noise: what errs has no frame as sure as that."""
    return Beside(excess, one.positions)


def _with_width(one: Erring, excess: float) -> Beside:
    """Return another maximum with how far its ranges reach from there."""
    _, _, sd, _ = one.at_ranges(one.positions)
    return Beside(excess, one.positions, np.where(np.isfinite(sd), sd, 0.0))


def _erring_answer(
    name: str, problem: FitProblem, starts: Sequence[Maximum], state: NDArray[np.uint8]
) -> TechniqueResult:
    """Build the result where the model errs."""
    problem, found, along = believed(problem, starts)
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
    rivals = rivals_of(problem, found, decided)
    # another mode of the law is another answer; near in the same mode, a wider one
    others = {place_of(one.clean.mode): one for one in reversed(rivals)}
    others.pop(place_of(top.clean.mode), None)
    if problem.priors:
        near = [one for one in (*rivals, *along) if one.deviance <= decided]
        wide: list[Erring] = []
    else:  # points beside a rival are decided against by as much more
        near, wide = [one for one in along if one.deviance <= decided + doubt * WITHIN], rivals
    widening = wider * math.sqrt(doubt)
    reports = [
        (end, fit_report(problem, found, end.chi_square, facts.rank, widening, checks))
        for end, checks in ((end, model_checks(problem, end)) for end in judged(found))
    ]
    report = reports[0][1]
    for end, of_end in reports:
        if of_end["misfit"]:
            report |= {name: of_end[name] for name in ("p_value", "misfit", "reasons", "checks")}
            report["reasons"] += blamed(problem, end, np.flatnonzero(state != SATURATED))
            break
    if problem.object_errs:
        report["checks"] = report["checks"] | {SCATTER: scatters_less(top, free_of(problem, top))}
    if contradicted:
        report["misfit"] = True
        report["reasons"].append(CONTRADICTION)
    parameters = describe(top.clean, top, top.facts, widening, near, top.whole, wide)
    if problem.priors:
        told = [parameters[name]["status"] == "identified" for name in problem.names]
        near += held_walks(problem, top, np.flatnonzero(told).tolist())
        parameters = describe(top.clean, top, top.facts, widening, near, top.whole, wide)
        alone = describe(top.clean, top, top.facts, widening, (), top.whole)
        places = [problem.natural(one.x) for one in rivals]
        elsewhere = {name: [x[j] for x in places] for j, name in enumerate(problem.names)}
        parameters = disputed(parameters, alone, elsewhere)
    points = [
        *(
            (beside if problem.priors else _alone)(one, (one.deviance - top.deviance) / doubt)
            for one in near
        ),
        *(
            _with_width(one, (one.deviance - top.deviance) / doubt)
            for one in wide
            if place_of(one.clean.mode) == place_of(top.clean.mode)
        ),
    ]
    ends = None
    if not report["misfit"]:  # else no range is told
        of_mode = dataclasses.replace(problem, mode=top.clean.mode)
        ends = far_ends(of_mode, top, doubt) / doubt
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
        Elsewhere(points, ends),
        contradicted,
        doubt,
    )
