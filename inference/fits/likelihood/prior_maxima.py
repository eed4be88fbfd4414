"""Maxima where priors count: frames alone leave too much open (docs/model.md, fit-priors)."""

import math
from collections.abc import Sequence

import numpy as np

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed, held_within_priors
from inference.fits.likelihood.erring_point import Point, point_at
from inference.fits.likelihood.frame_modes import frame_modes
from inference.fits.likelihood.maximum import DECIDED, TOP, Maximum
from inference.fits.likelihood.other_places import beyond_walls
from inference.fits.likelihood.polish import polish
from inference.fits.likelihood.problem import FitProblem

__all__ = ["prior_maxima"]

# steps of the climbs, and how many of the best go on; the last are the ends
_ROUNDS = ((4, 10), (12, 5), (60, 5))
_SAME = 0.3  # standard deviations of the priors between points that are one
_NEARLY = 0.2  # of log r, within which ranges are nearly the same
_ALIKE = 3  # points that tell nearly the same ranges
_AT_END = 1e-6  # of log r
_TURNED = 4  # frames that are given other ranges
_OTHER = 30.0  # deviance by which another range of a frame may be worse, all else as it is
_AFTER = 12  # steps of such a climb
_BASES = 2  # ends from which others are looked for beyond walls
_FAR = 100.0  # deviance by which such an end may be worse
_BEYOND, _RELEASED = 6, 30  # of what is found there, and steps of their climbs
_KEPT = 12  # ends


def prior_maxima(problem: FitProblem, starts: Sequence[Maximum]) -> list[Erring]:
    """Climb from starting points, and from each held within the priors.

    Parameters
    ----------
    problem : FitProblem
        The problem, with priors of the unknowns.
    starts : sequence of Maximum
        Optima of the likelihood alone, and points on the way to some.

    Returns
    -------
    list of Erring
        Ends of the best climbs, the best first.
    """
    first: list[Point] = []
    for start in starts:
        if not (np.isfinite(start.x).all() and np.isfinite(start.deviance)):
            continue
        inward = held_within_priors(problem, start.x)
        apart = (start.x, inward) if not np.allclose(inward, start.x) else (start.x,)
        first += [begun(problem, x, start.positions) for x in apart]
    ends = _climbed(problem, first)
    if ends:
        ends += _climbed(problem, _turned(problem, ends[0][0]), _ROUNDS[1:])
    ends = [polished(problem, *end) for end in ends]
    ends.sort(key=lambda end: end[0].deviance)
    bases: list[Point] = []
    for _ in range(_BASES if ends else 0):
        base = _next_base(ends, bases)
        if base is None:
            break
        bases.append(base[0])
        found = _apart(beyond_walls(problem, end_of(problem, *base)), _BEYOND)
        ends += [polished(problem, *climbed(problem, at, _RELEASED)) for at, _ in found]
        ends = _apart(ends, _KEPT)
    near = [
        _at_top(problem, *end) for end in ends if end[0].deviance < ends[0][0].deviance + DECIDED
    ]
    ends = sorted([*near, *ends[len(near) :]], key=lambda end: end[0].deviance)
    return [end_of(problem, at, remaining) for at, remaining in ends]


def _next_base(
    ends: Sequence[tuple[Point, float]], before: Sequence[Point]
) -> tuple[Point, float] | None:
    """Return the best end with other ranges than those from where was looked before."""
    for end in ends:
        if end[0].deviance - ends[0][0].deviance > _FAR:
            break
        if not any(_ranges_alike(end[0], base) for base in before):
            return end
    return None


def polished(problem: FitProblem, at: Point, remaining: float) -> tuple[Point, float]:
    """Follow the end of a climb to the top; it stays where it is if that is no better."""
    x, deviance, left, positions = polish(problem, at.x)
    if not deviance < at.deviance:
        return at, remaining
    there = point_at(problem, x, positions, at.a)
    return (there, left) if there.deviance < at.deviance else (at, remaining)


def _at_top(problem: FitProblem, at: Point, remaining: float) -> tuple[Point, float]:
    """Climb and follow again where the top was not reached."""
    if remaining <= TOP:
        return at, remaining
    at, more = climbed(problem, at, _AFTER)
    return polished(problem, at, min(remaining, more))


def _climbed(
    problem: FitProblem, points: Sequence[Point], rounds: Sequence[tuple[int, int]] = _ROUNDS
) -> list[tuple[Point, float]]:
    """Climb in rounds, each from the best ends of the one before, the best first."""
    found = [(at, math.inf) for at in points]
    for steps, most in rounds:
        found = [climbed(problem, at, steps) for at, _ in found]
        found = _apart(found, most)
    return found


def _apart(found: Sequence[tuple[Point, float]], most: int) -> list[tuple[Point, float]]:
    """Return the best ends, few of them with nearly the same ranges, the best first."""
    apart: list[tuple[Point, float]] = []
    for end in sorted(found, key=lambda end: end[0].deviance):
        if len(apart) == most or not math.isfinite(end[0].deviance):
            break
        alike = sum(_ranges_alike(end[0], other) for other, _ in apart)
        if alike < _ALIKE and not any(_same(end[0], other) for other, _ in apart):
            apart.append(end)
    return apart


def _same(at: Point, other: Point) -> bool:
    """Return whether two points are one place of a valley, in standard deviations of the priors."""
    near = float(np.linalg.norm(at.z - other.z)) < _SAME
    return near and abs(at.deviance - other.deviance) < 1.0


def _ranges_alike(at: Point, other: Point) -> bool:
    """Return whether two points tell nearly the same ranges: of these a few are enough."""
    away = np.abs(at.u - other.u)
    return not np.isfinite(away).any() or bool(np.nanmedian(away) < _NEARLY)


def _turned(problem: FitProblem, at: Point) -> list[Point]:
    """Return starts of which one frame has another of its ranges, at an end of the ranges first.

    A climb follows the mode of a frame that it began with, and bends everything else towards it.
    """
    low, high = np.log(problem.support)
    modes, deviances = frame_modes(problem, at.x)
    away = np.abs(modes - at.u[:, None])
    own = np.where(np.isfinite(away), away, np.inf).argmin(axis=1)
    frames = np.arange(at.u.size)
    ranked = np.where(np.isfinite(modes), deviances, np.inf)
    with np.errstate(invalid="ignore"):
        excess = ranked - ranked[frames, own][:, None]
    excess = np.where(np.isfinite(excess), excess, np.inf)
    excess[frames, own] = np.inf
    other = excess.argmin(axis=1)
    least = excess[frames, other]
    ended = (at.u < low + _AT_END) | (at.u > high - _AT_END)
    order = np.lexsort((least, ~ended))
    turned = []
    for frame in order[least[order] < _OTHER][:_TURNED].tolist():
        u = at.u.copy()
        u[frame] = modes[frame, other[frame]]
        turned.append(begun(problem, at.x, u))
    return turned
