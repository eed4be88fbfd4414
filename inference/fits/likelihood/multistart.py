"""Maxima of the likelihood from starting points that need no guess."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.fits.likelihood.conditional_fit import conditional, unconditional
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import MANY, TOP, Maximum, approach, followed
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.screen import screen
from inference.identifiability.information import Information

__all__ = ["BREADTH", "find_maxima"]

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
_EASY = 5  # unknowns
_WAVES = 3  # of such tries, as long as they help
_RESTARTED = 3  # unknowns of which other values are tried once more
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
_FOLLOWED = 4  # of them, to the top
_PROMISING = 50.0  # deviance above the best up to which such a try is followed


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
    z = special.ndtri(uniform[:, : len(parameters)]) * BREADTH
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
    """Look for more from the best optimum, its weakest unknowns held elsewhere for a while."""
    _, facts = residuals_and_information(problem, best.x, best.positions)
    weakest = np.argsort(-np.where(problem.logarithms, facts.sd, 0.0), kind="stable")
    found: list[Maximum] = []
    for j in weakest[:_RESTARTED].tolist():
        for value in np.quantile(starts[:, j], _QUANTILES):
            x = best.x.copy()
            x[j] = value
            smaller, rest = conditional(problem, j, x)
            there = approach(smaller, rest, MANY // 2)
            if there.deviance < best.deviance + _PROMISING:
                whole = unconditional(problem, smaller, there.x)
                found.append(approach(problem, whole, MANY // 2))
    found.sort(key=lambda optimum: optimum.deviance)
    return [followed(problem, optimum) for optimum in found[:_FOLLOWED]]


def _distinct(optima: list[Maximum], information: list[Information]) -> list[int]:
    """Return the indices of optima that are not one with a better one before them."""
    kept: list[int] = []
    for i, optimum in enumerate(optima):
        twin = False
        for k in kept:
            change = information[k].jacobian @ (optimum.x - optima[k].x)
            close = optimum.deviance - optima[k].deviance < 1.0
            twin = twin or (close and float(np.linalg.norm(change)) < _SAME)
        if not twin:
            kept.append(i)
    return kept


def find_maxima(problem: FitProblem) -> tuple[Maximum, ...]:
    """Find the optima of a fit, the best first.

    Parameters
    ----------
    problem : FitProblem
        At least as many frames as the unknowns need.

    Returns
    -------
    tuple of Maximum
        Distinct ones; empty where no starting point has any likelihood.
    """
    order, empty = _by_light(problem)
    chosen = np.sort(np.concatenate([_spread(order, _FRAMES), _spread(empty, 6)]))
    few = problem.select(chosen) if chosen.size < problem.present.size else problem
    effort = _LITTLE if len(problem) <= _EASY else _MUCH
    starts = _starts(few, effort.points)
    first = [approach(few, x, effort.few) for x in starts[: effort.climbs]]
    first.sort(key=lambda optimum: optimum.deviance)
    second = [approach(problem, optimum.x, effort.many) for optimum in first[: effort.kept]]
    second.sort(key=lambda optimum: optimum.deviance)
    last = [followed(problem, optimum) for optimum in second[: effort.polished]]
    last = [optimum for optimum in last if np.isfinite(optimum.deviance)]
    last.sort(key=lambda optimum: optimum.deviance)
    for _ in range(_WAVES if last and len(problem) > _EASY else 0):
        before = last[0].deviance
        last += _second_wave(problem, last[0], starts)
        last.sort(key=lambda optimum: optimum.deviance)
        if before - last[0].deviance < TOP:
            break
    facts = [residuals_and_information(problem, top.x, top.positions)[1] for top in last]
    return tuple(last[i] for i in _distinct(last, facts))
