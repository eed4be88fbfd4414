"""The maxima of a fit whose model errs, the most probable first, and what lies beside them."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from inference.fits.answer.larger_error import DOUBLINGS, is_default, twice_as_large
from inference.fits.answer.model_checks import model_checks
from inference.fits.answer.ranges import WITHIN
from inference.fits.answer.report import DOUBTFUL, FALSE_ALARM, fit_report
from inference.fits.likelihood.erring import Erring, end_from, erring_maxima
from inference.fits.likelihood.erring_profile import profiles
from inference.fits.likelihood.erring_valley import near, valleys
from inference.fits.likelihood.evidence import evidence_of
from inference.fits.likelihood.integrated import with_integrated_first
from inference.fits.likelihood.law_mode import is_glossy, place_of
from inference.fits.likelihood.maximum import TOP, Maximum
from inference.fits.likelihood.prior_maxima import prior_maxima
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.range_walks import range_walks
from simulator.errors import RefusedError

__all__ = ["NO_LIKELIHOOD", "believed", "judged"]

NO_LIKELIHOOD = (
    "no values of the unknowns give the readings a likelihood that can be computed; check gain, "
    "noise and range_m"
)
_WALKS = 3  # that may meet a better maximum than the last
_CROSSED = 2  # best maxima of one mode from which others are climbed to


def believed(
    problem: FitProblem, starts: Sequence[Maximum]
) -> tuple[FitProblem, list[Erring], list[Erring]]:
    """Return the problem, with a larger error of the model where the frames ask, and its maxima.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs, or with priors of the unknowns.
    starts : sequence of Maximum
        Where climbs begin.

    Returns
    -------
    (FitProblem, list of Erring, list of Erring)
        The maxima, the most probable first, and points beside them. Deviances above that of the
        first are those of how probable they are, widths and all (`evidence_of`).

    Raises
    ------
    RefusedError
        Where nothing has a likelihood.
    """
    found, along = _searched(problem, starts)
    if not is_default(problem) or not FALSE_ALARM <= _probability(problem, found) < DOUBTFUL:
        return problem, found, along
    for _ in range(DOUBLINGS):
        larger = twice_as_large(problem)
        more, beside = _searched(larger, [*starts, *found])
        if not evidence_of(more[0]) > evidence_of(found[0]):
            break
        problem, found, along = larger, more, beside
    return problem, found, along


def judged(found: Sequence[Erring]) -> list[Erring]:
    """Return the maxima that have to explain the frames: the first, and that of a diffuse object.

    Light that a scene leaves out is much like that of a glossy object: that the object may be one
    widens an answer, and explains nothing away.

    Parameters
    ----------
    found : sequence of Erring
        Maxima, the most probable first.
    """
    mode = found[0].clean.mode
    diffuse = [
        end
        for end in found
        if place_of(end.clean.mode) == place_of(mode) and not is_glossy(end.clean.mode)
    ]
    return [found[0], *diffuse[:1]] if is_glossy(mode) else [found[0]]


def _probability(problem: FitProblem, found: Sequence[Erring]) -> float:
    """Return the p-value of a best fit, by all its checks."""
    return min(
        float(fit_report(problem, [end], end.chi_square, 0, 1.0, checks)["p_value"])
        for end, checks in ((end, model_checks(problem, end)) for end in judged(found))
    )


def _searched(problem: FitProblem, starts: Sequence[Maximum]) -> tuple[list[Erring], list[Erring]]:
    """Return the maxima, the most probable first, and points along their valleys."""
    climb = prior_maxima if problem.priors else erring_maxima
    alone = [dataclasses.replace(problem, mode=mode) for mode in problem.modes]
    found = [end for one in alone for end in climb(one, starts)]
    if not found:
        raise RefusedError(NO_LIKELIHOOD)
    if problem.priors:
        return _by_ranges(problem, found)
    for one in alone if len(alone) > 1 else ():
        best = _weighed(end for end in found if end.clean.mode is not one.mode)
        found += [end_from(one, other.end) for other in best[:_CROSSED]]
    return _by_evidence(problem, found)


def _by_ranges(problem: FitProblem, found: list[Erring]) -> tuple[list[Erring], list[Erring]]:
    """Walk along what the ranges share, from maxima of an exact model."""
    found.sort(key=lambda end: end.deviance)
    along: list[Erring] = []
    for _ in range(_WALKS):
        along, better = range_walks(problem, found)
        if better is None or not better.deviance < found[0].deviance:
            break
        found.insert(0, better)
    return with_integrated_first(found, along)


class _Weighed(NamedTuple):
    evidence: float
    end: Erring


def _weighed(found: Iterable[Erring]) -> list[_Weighed]:
    """Return maxima, the most probable first; what has no evidence is none where others have."""
    # where a climb stopped early it says nothing of what it might have gained
    each = [_Weighed(evidence_of(end) - end.remaining, end) for end in found]
    known = [one for one in each if math.isfinite(one.evidence)]
    known = known or [_Weighed(-one.end.deviance, one.end) for one in each]
    return sorted(known, key=lambda one: -one.evidence)


def _by_evidence(problem: FitProblem, found: Sequence[Erring]) -> tuple[list[Erring], list[Erring]]:
    """Follow valleys from the most probable maxima; each counts by how probable it is."""
    weighed, along = _weighed(found), list[Erring]()
    for _ in range(_WALKS):
        if weighed[0].end.remaining > TOP:
            end = weighed[0].end
            farther = end_from(dataclasses.replace(problem, mode=end.clean.mode), end)
            weighed = _weighed([farther, *(one.end for one in weighed[1:])])
        first = weighed[0]
        place = place_of(first.end.clean.mode)
        alike = [one for one in weighed if place_of(one.end.clean.mode) == place]
        along, others = valleys(
            problem, [(one.end, first.evidence - one.evidence) for one in alike]
        )
        weighed = _weighed([*(one.end for one in weighed), *others])
        if weighed[0].end is first.end:
            along += _profiles_of(problem, first, alike)
            break
    weighed = _distinct(weighed)
    top = weighed[0]
    lower = top.end.deviance - first.end.deviance + top.evidence - first.evidence
    return (
        [_at(one.end, top.end.deviance + top.evidence - one.evidence) for one in weighed],
        [_at(point, point.deviance + lower) for point in along],
    )


def _distinct(weighed: Sequence[_Weighed]) -> list[_Weighed]:
    """Return maxima that are not one with a more probable one of the same mode."""
    kept: list[_Weighed] = []
    for one in weighed:
        mode = one.end.clean.mode
        same = (other.end for other in kept if other.end.clean.mode is mode)
        if not any(near(other, one.end) for other in same):
            kept.append(one)
    return kept


def _profiles_of(problem: FitProblem, first: _Weighed, alike: Sequence[_Weighed]) -> list[Erring]:
    """Hold ranges at the best maximum of each mode; deviances count above that of the first."""
    points: list[Erring] = []
    seen: set[int] = set()
    for one in alike:
        mode, excess = one.end.clean.mode, first.evidence - one.evidence
        if id(mode) in seen or not excess < WITHIN:
            continue
        seen.add(id(mode))
        raised = first.end.deviance + excess - one.end.deviance
        along = profiles(dataclasses.replace(problem, mode=mode), one.end)
        points += [_at(point, point.deviance + raised) for point in along]
    return points


def _at(end: Erring, deviance: float) -> Erring:
    return dataclasses.replace(end, deviance=deviance)
