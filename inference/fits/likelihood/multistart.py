"""Optima of a fit from starting points that need no guess."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.fits.likelihood.climb import climb
from inference.fits.likelihood.conditional_fit import held, released
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.polish import polish
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.screen import screen
from inference.identifiability.information import Information

__all__ = ["BREADTH", "Optimum", "climb_from", "find_optima", "optimum_from"]

Array = NDArray[np.float64]

BREADTH = 1.3  # of the screen against the priors
_ANCHORS = 2
_JUDGES = 12  # frames that score a point of the screen
_FRAMES = 48  # that take part while optima are looked for
_DAMPING = 1e-3
_TOP = 1e-3  # deviance that may remain to be gained
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
_MUCH = _Effort(points=600, climbs=24, few=10, kept=8, many=100, polished=6)
_EASY = 5  # unknowns
_WAVES = 3  # of such tries, as long as they help
_RESTARTED = 3  # unknowns of which other values are tried once more
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
_FOLLOWED = 4  # of them, to the top
_PROMISING = 50.0  # deviance above the best up to which such a try is followed


@dataclasses.dataclass(frozen=True, eq=False)
class Optimum:
    """A local maximum of the likelihood.

    Attributes
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    deviance : float
        -2 log likelihood, relative to no residual under read noise alone.
    remaining : float
        Deviance that a whole Newton step would still gain: 0 at the top.
    positions : ndarray, shape (n,)
        log r of every frame; nan without an object.
    """

    x: Array
    deviance: float
    remaining: float
    positions: Array


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
    if problem.instrument[1] is None:
        return np.asarray(second / gain)
    return np.asarray(np.hypot(first, second) / gain)


def _spread(order: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Pick members of an order at even distances, both ends included."""
    if order.size == 0:
        return order
    return order[np.unique(np.linspace(0, order.size - 1, count).round().astype(np.intp))]


def _starts(problem: FitProblem, count: int) -> Array:
    """Return the points of the screen, the best first; those without likelihood left out."""
    parameters = problem.parameters
    light = _light(problem)
    objects = np.flatnonzero(problem.present)
    order = objects[np.argsort(-light[objects], kind="stable")]
    empty = np.flatnonzero(~problem.present)
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
    screen(
        points,
        scores,
        np.ascontiguousarray(ordered),
        np.searchsorted(judges, anchors).astype(np.int64),
        few.layout,
        few.work(),
        few.support[0],
        few.gain,
        few.background,
        few.frames,
        few.present,
        few.instrument,
    )
    best = np.argsort(scores, kind="stable")
    return np.asarray(points[best[np.isfinite(scores[best])]])


def climb_from(problem: FitProblem, x: Array, steps: int) -> Optimum:
    """Climb from a point by Levenberg-Marquardt steps.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Start.
    steps : int
        At most so many.

    Returns
    -------
    Optimum
        Its deviance is inf where the start has no likelihood.
    """
    x = np.array(x, dtype=np.float64)
    best = np.full((1, problem.frames.shape[0], 3), np.nan)
    report = np.array([np.inf, np.inf, 0.0, _DAMPING])
    climb(
        x,
        best,
        report,
        problem.layout,
        problem.work(),
        problem.support[0],
        problem.gain,
        problem.background,
        problem.frames,
        problem.present,
        problem.instrument,
        steps,
    )
    return Optimum(x, float(report[0]), float(report[1]), best[0, :, 0].copy())


def _to_the_top(problem: FitProblem, optimum: Optimum) -> Optimum:
    """Follow with Newton steps where the top is not reached."""
    if np.isfinite(optimum.deviance) and optimum.remaining > _TOP:
        return Optimum(*polish(problem, optimum.x))
    return optimum


def optimum_from(problem: FitProblem, x: Array) -> Optimum:
    """Climb from a point to the top.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Start.

    Returns
    -------
    Optimum
        Its deviance is inf where the start has no likelihood.
    """
    return _to_the_top(problem, climb_from(problem, x, _MUCH.many))


def _second_wave(problem: FitProblem, best: Optimum, starts: Array) -> list[Optimum]:
    """Look for more from the best optimum, its weakest unknowns held elsewhere for a while."""
    _, facts = residuals_and_information(problem, best.x, best.positions)
    weakest = np.argsort(-np.where(np.isin(problem.slots, (3, 4)), 0.0, facts.sd), kind="stable")
    found: list[Optimum] = []
    for j in weakest[:_RESTARTED].tolist():
        for value in np.quantile(starts[:, j], _QUANTILES):
            x = best.x.copy()
            x[j] = value
            smaller, rest = held(problem, j, x)
            there = climb_from(smaller, rest, _MUCH.many // 2)
            if there.deviance < best.deviance + _PROMISING:
                whole = released(problem, smaller, there.x)
                found.append(climb_from(problem, whole, _MUCH.many // 2))
    found.sort(key=lambda optimum: optimum.deviance)
    return [_to_the_top(problem, optimum) for optimum in found[:_FOLLOWED]]


def _distinct(optima: list[Optimum], information: list[Information]) -> list[int]:
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


def find_optima(problem: FitProblem) -> tuple[Optimum, ...]:
    """Find the optima of a fit, the best first.

    Parameters
    ----------
    problem : FitProblem
        At least as many frames as the unknowns need.

    Returns
    -------
    tuple of Optimum
        Distinct ones; empty where no starting point has any likelihood.
    """
    light = _light(problem)
    objects = np.flatnonzero(problem.present)
    order = objects[np.argsort(-light[objects], kind="stable")]
    empty = np.flatnonzero(~problem.present)
    chosen = np.sort(np.concatenate([_spread(order, _FRAMES), _spread(empty, 6)]))
    few = problem.select(chosen) if chosen.size < problem.present.size else problem
    effort = _LITTLE if len(problem) <= _EASY else _MUCH
    starts = _starts(few, effort.points)
    first = [climb_from(few, x, effort.few) for x in starts[: effort.climbs]]
    first.sort(key=lambda optimum: optimum.deviance)
    second = [climb_from(problem, optimum.x, effort.many) for optimum in first[: effort.kept]]
    second.sort(key=lambda optimum: optimum.deviance)
    last = [_to_the_top(problem, optimum) for optimum in second[: effort.polished]]
    last = [optimum for optimum in last if np.isfinite(optimum.deviance)]
    last.sort(key=lambda optimum: optimum.deviance)
    for _ in range(_WAVES if last and len(problem) > _EASY else 0):
        before = last[0].deviance
        last += _second_wave(problem, last[0], starts)
        last.sort(key=lambda optimum: optimum.deviance)
        if before - last[0].deviance < _TOP:
            break
    facts = [residuals_and_information(problem, top.x, top.positions)[1] for top in last]
    return tuple(last[i] for i in _distinct(last, facts))
