"""Maxima of the likelihood from starting points that need no guess."""

import dataclasses
from collections.abc import Iterable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.conditional_fit import conditional, unconditional
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import (
    MANY,
    TOP,
    Maximum,
    approach,
    followed,
    maximum_from,
)
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.screen import screen
from inference.identifiability.information import Information

__all__ = ["BREADTH", "EASY", "find_maxima", "find_near", "find_starts"]

Array = NDArray[np.float64]

BREADTH = 1.3  # of the screen against the priors
_ANCHORS = 2
_JUDGES = 12  # frames that score a point of the screen
_FRAMES = 48  # that take part while optima are looked for
_SAME = 0.5  # standard deviations between optima that are one


@dataclasses.dataclass(frozen=True)
class _Effort:
    """How widely optima are looked for.

    Attributes
    ----------
    points : int
        Of the screen.
    climbs : int
        Best points that are climbed a little.
    few : int
        Steps of that.
    kept : int
        Best of those, which are climbed further.
    many : int
        Steps of that.
    polished : int
        Best of those, which are followed to the top.
    """

    points: int
    climbs: int
    few: int
    kept: int
    many: int
    polished: int


_LITTLE = _Effort(points=300, climbs=12, few=6, kept=4, many=40, polished=3)
# with crosstalk and background together optima lie in long flat valleys
_MUCH = _Effort(points=600, climbs=24, few=10, kept=8, many=MANY, polished=6)
EASY = 5  # unknowns
_WAVES = 3  # of such tries, as long as they help
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)  # values of each unknown that are tried
_HELD, _RELEASED = 30, 60  # steps of a try while its unknown is held, and after that
_FOLLOWED = 6  # of them, to the top
_MOST = 12  # optima that are kept
_NEAR = 3  # points near optima


def _low_discrepancy(n: int, d: int) -> Array:
    """Additive recurrence with the generalised golden ratio, shape (n, d), in (0, 1)."""
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (d + 1))
    steps = ratio ** -np.arange(1.0, d + 1)
    return np.asarray((0.5 + np.arange(1.0, n + 1)[:, None] * steps) % 1.0)


def _light(problem: FitProblem) -> Array:
    """Brightness of each frame: w2 or the modulus, over the gain factor, shape (n,)."""
    first, second, gain = problem.frames.T
    if problem.instrument.wave is None:
        return np.asarray(second / gain)
    return np.asarray(np.hypot(first, second) / gain)


def _spread(order: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Pick members of an order at even distances, both ends included."""
    if order.size == 0:
        return order
    return order[np.unique(np.linspace(0, order.size - 1, count).round().astype(np.intp))]


def _by_light(problem: FitProblem) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the frames with an object, the brightest first, and those without."""
    light, objects = _light(problem), np.flatnonzero(problem.present)
    order = objects[np.argsort(-light[objects], kind="stable")]
    return order, np.flatnonzero(~problem.present)


def _starts(problem: FitProblem, count: int) -> Array:
    """Return the points of the screen, the best first; those without likelihood left out."""
    parameters = problem.parameters
    order, empty = _by_light(problem)
    anchors = _spread(order, _ANCHORS)
    uniform = _low_discrepancy(count, len(parameters) + anchors.size)
    z = scipy.special.ndtri(uniform[:, : len(parameters)]) * BREADTH
    columns = [parameters.names.index(name) for name in problem.names]
    points = problem.coordinates(parameters.natural(z)[:, columns])
    low, high = np.log(problem.support)
    ranges = low + (high - low) * uniform[:, len(parameters) :]
    # brighter is nearer, but for a background that outshines the object
    ordered = np.sort(ranges, axis=1)
    if problem.background is not None:
        ordered[1::2] = ranges[1::2]
    if empty.size:
        anchors = np.append(anchors, empty[0])
        ordered = np.column_stack([ordered, np.full(count, np.nan)])
    judges = np.unique(np.concatenate([_spread(order, _JUDGES), empty[:1], anchors]))
    few = problem.select(judges)
    scores = np.empty(count)
    points = np.ascontiguousarray(points)
    ordered = np.ascontiguousarray(ordered)
    screen(points, scores, ordered, np.searchsorted(judges, anchors), few.kernel_fit())
    best = np.argsort(scores, kind="stable")
    return np.asarray(points[best[np.isfinite(scores[best])]])


def _second_wave(problem: FitProblem, best: Maximum, starts: Array) -> list[Maximum]:
    """Look for more from the best optimum, each of its unknowns held elsewhere for a while.

    Optima that explain the frames nearly as well lie far apart along one or two unknowns, with
    walls between them that grow with the square of the readings over their noise: how well the
    frames are explained while an unknown is held says nothing of what lies behind.
    """
    found: list[Maximum] = []
    for j in np.flatnonzero(problem.logarithms).tolist():
        for value in np.quantile(starts[:, j], _QUANTILES):
            x = best.x.copy()
            x[j] = value
            smaller, rest = conditional(problem, j, x)
            there = approach(smaller, rest, _HELD)
            whole = unconditional(problem, smaller, there.x)
            found.append(approach(problem, whole, _RELEASED))
    # most tries come back to the same few optima
    apart = _distinct(problem, [best, *found], _FOLLOWED + 1)
    return [followed(problem, optimum) for optimum in apart if optimum is not best]


def _distinct(problem: FitProblem, optima: list[Maximum], most: int) -> list[Maximum]:
    """Return the best optima that are not one with a better one, the best first."""
    kept: list[Maximum] = []
    facts: list[Information] = []
    for optimum in sorted(optima, key=lambda one: one.deviance):
        if len(kept) == most or not np.isfinite(optimum.deviance):
            break
        twin = False
        for other, there in zip(kept, facts, strict=True):
            change = there.jacobian @ (optimum.x - other.x)
            close = optimum.deviance - other.deviance < 1.0
            twin = twin or (close and float(np.linalg.norm(change)) < _SAME)
        if not twin:
            kept.append(optimum)
            facts.append(residuals_and_information(problem, optimum.x, optimum.positions)[1])
    return kept


def _screened(problem: FitProblem) -> tuple[NDArray[np.intp], Array, _Effort]:
    """Return the frames that are enough to look for optima, the screen, and the effort."""
    order, empty = _by_light(problem)
    chosen = np.sort(np.concatenate([_spread(order, _FRAMES), _spread(empty, 6)]))
    effort = _LITTLE if len(problem) <= EASY else _MUCH
    return chosen, _starts(problem.select(chosen), effort.points), effort


def _climbed(
    problem: FitProblem, chosen: NDArray[np.intp], starts: Array, effort: _Effort
) -> list[Maximum]:
    """Return ends of the best climbs, the best first."""
    few = problem.select(chosen)
    first = [approach(few, x, effort.few) for x in starts[: effort.climbs]]
    first.sort(key=lambda optimum: optimum.deviance)
    second = [approach(problem, optimum.x, effort.many) for optimum in first[: effort.kept]]
    second.sort(key=lambda optimum: optimum.deviance)
    return second


def find_starts(problem: FitProblem, softer: Iterable[FitProblem]) -> tuple[Maximum, ...]:
    """Find points near optima of a fit, none of them followed to the top.

    Parameters
    ----------
    problem : FitProblem
        At least as many frames as the unknowns need.
    softer : iterable of FitProblem
        The same frames with more noise, whose optima count too.

    Returns
    -------
    tuple of Maximum
        Distinct ones of each problem, the best of it first.
    """
    softer = tuple(softer)
    found: list[Maximum] = []
    for support in (problem.support, *problem.windows):
        # points are judged so roughly that the noise does not matter
        screened = _screened(dataclasses.replace(problem, support=support))
        for one in (*softer, problem):
            part = dataclasses.replace(one, support=support)
            found += _distinct(part, _climbed(part, *screened), _NEAR)
    return tuple(found)


def find_near(problem: FitProblem) -> list[Maximum]:
    """Return ends of the first short climbs: near optima that the best ones hide, too.

    Parameters
    ----------
    problem : FitProblem
        At least as many frames as the unknowns need.
    """
    chosen, starts, effort = _screened(problem)
    few = problem.select(chosen)
    first = [approach(few, x, effort.few) for x in starts[: effort.climbs]]
    return (
        first
        if chosen.size == problem.present.size
        else [approach(problem, end.x, 1) for end in first]
    )


def find_maxima(problem: FitProblem, waves: int = _WAVES) -> tuple[Maximum, ...]:
    """Find the optima of a fit, the best first.

    Parameters
    ----------
    problem : FitProblem
        At least as many frames as the unknowns need.
    waves : int
        How often more are looked for from the best one, at most.

    Returns
    -------
    tuple of Maximum
        Distinct ones; empty where no starting point has any likelihood.
    """
    chosen, starts, effort = _screened(problem)
    second = _climbed(problem, chosen, starts, effort)
    last = [followed(problem, optimum) for optimum in second[: effort.polished]]
    for support in problem.windows:
        part = dataclasses.replace(problem, support=support)
        there = _climbed(part, *_screened(part))[: effort.polished]
        last += [maximum_from(problem, end.x) for end in there if np.isfinite(end.x).all()]
    last = _distinct(problem, last, _MOST)
    for _ in range(waves if last and len(problem) > EASY else 0):
        before = last[0].deviance
        last = _distinct(problem, last + _second_wave(problem, last[0], starts), _MOST)
        if before - last[0].deviance < TOP:
            break
    return tuple(last)
