"""Valleys of the likelihood where the model errs: how far they reach beyond what curvature says.

Few frames that tell little leave long valleys that are flat, and a narrow optimum somewhere beside
them: curvature there says a width that is a tenth of what the deviance says, and the truth was seen
19 standard deviations off at a deviance of 2. Others rise soon and then hardly any more: what is
far out then has more mass than its deviance says. So from every optimum that is nearly as good as
the best, each unknown is held away on both sides while everything else follows, for as long as its
marginal density falls by less than curvature foresees; a point counts as far out as the mass beyond
it says.
"""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.evidence import evidence_of
from inference.fits.likelihood.frame_modes import nearest_modes
from inference.fits.likelihood.problem import FitProblem

__all__ = ["Step", "as_far_as_mass_says", "masses", "near", "valleys"]

Array = NDArray[np.float64]

_STEPS = 8  # of a climb with an unknown held
_FIRST = 2.0  # standard deviations to where an unknown is held first
_ENOUGH = 4.0  # deviance that two standard deviations cost
_FLAT = 0.7  # of the fall that curvature foresees, below which a valley is followed
_NOTHING = 12.0  # twice the log by which a density has fallen to where nothing is left
_DOUBLINGS = 6
_BASES = 3  # optima whose valleys are followed
_ONE = 0.1  # standard deviations between two ends that are one
_APART = 0.1  # of log r of a frame, from which on they are two
_STRIDE = 1.0  # most that a logarithm is moved at once
_BETTER = 0.05  # deviance by which another optimum is better


class Step(NamedTuple):
    """A point of a valley.

    Attributes
    ----------
    away : float
        From the maximum, in its standard deviations of the unknown that is held.
    cost : float
        Minus twice the log of that unknown's marginal density, over that at the maximum.
    end : Erring
        All else.
    """

    away: float
    cost: float
    end: Erring


def valleys(
    problem: FitProblem, found: Sequence[tuple[Erring, float]]
) -> tuple[list[Erring], list[Erring]]:
    """Follow the valleys that the most probable maxima lie in.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    found : sequence of (Erring, float)
        Its maxima, each of its own mode, with what counts as their deviances above that of the
        first, in this order.

    Returns
    -------
    (list of Erring, list of Erring)
        Points that are optimal but for one unknown, farther out than curvature has them at their
        deviance, which counts as above the first maximum's; and maxima of less deviance than any
        before, if such were met.
    """
    points: list[Erring] = []
    lower: list[Erring] = []
    bases: list[Erring] = []
    lowest: dict[int, float] = {}  # of each mode
    for base, _ in found:
        mode = id(base.clean.mode)
        lowest[mode] = min(base.deviance, lowest.get(mode, math.inf))
    for base, excess in found:
        if len(bases) == _BASES or not excess < _ENOUGH:
            break
        if any(near(base, other) for other in bases):
            continue
        bases.append(base)
        alone, mode = dataclasses.replace(problem, mode=base.clean.mode), id(base.clean.mode)
        more, end = _valley(alone, base, lowest[mode])
        raised = found[0][0].deviance + excess - base.deviance
        points += [dataclasses.replace(one, deviance=one.deviance + raised) for one in more]
        if end is not None:
            lower.append(end)
            lowest[mode] = end.deviance
    return points, lower


def near(one: Erring, other: Erring) -> bool:
    """Return whether two ends of climbs are one optimum, to a part of its standard deviations."""
    of_x, _ = other.whole.factors
    sds = np.linalg.norm(of_x, axis=1)
    alike = (np.abs(one.x - other.x) < _ONE * sds).all()
    return bool(alike and np.nanmax(np.abs(one.positions - other.positions), initial=0.0) < _APART)


def _valley(problem: FitProblem, base: Erring, lowest: float) -> tuple[list[Erring], Erring | None]:
    """Follow a valley to both sides of each unknown, or to where a lower one begins."""
    points: list[Erring] = []
    of_x, _ = base.whole.factors
    sds = np.linalg.norm(of_x, axis=1)
    for j in np.flatnonzero(np.isfinite(sds) & (sds > 0.0)).tolist() if len(problem) > 1 else []:
        sides: list[list[Step]] = []
        for sign in (1.0, -1.0):
            side, lower = _side(problem, base, j, sign * of_x @ of_x[j] / sds[j], lowest)
            if lower is not None:
                return points, lower
            sides.append(side)
        points += as_far_as_mass_says(sides, base.deviance)
    return points, None


def _side(
    problem: FitProblem, base: Erring, j: int, ahead: Array, lowest: float
) -> tuple[list[Step], Erring | None]:
    """Hold an unknown farther and farther away to one side, or come to where a lower one begins."""
    side: list[Step] = []
    sd, middle = float(np.linalg.norm(base.whole.factors[0][j])), evidence_of(base, j)
    x, positions, reach, before = base.x, base.positions, _FIRST, 0.0
    for _ in range(_DOUBLINGS):
        step = (reach - before) * ahead
        longest = float(np.abs(step[problem.logarithms]).max(initial=0.0))
        start = x + step * min(1.0, _STRIDE / max(longest, 1e-300))
        start = np.clip(start, *problem.bounds(x))
        ranges = nearest_modes(problem, start, positions)
        at, _ = climbed(problem, begun(problem, start, ranges), _STEPS, j)
        cost = at.deviance - base.deviance
        if not math.isfinite(cost):
            break
        if at.deviance < lowest - _BETTER:
            end, remaining = climbed(problem, at, 5 * _STEPS)
            if end.deviance < lowest - _BETTER:
                return side, end_of(problem, end, remaining)
        if cost < -_BETTER:  # the valley of a maximum that is known, and counts by itself
            break
        end_here = end_of(problem, at, 0.0)
        away, cost = abs(float(at.x[j] - base.x[j])) / sd, middle - evidence_of(end_here, j)
        if not math.isfinite(cost) or (side and not away > side[-1].away):
            break
        side.append(Step(away, cost, end_here))
        if _is_followed(side[-1]):
            break
        x, positions, before, reach = at.x, at.u, reach, 2.0 * reach
    return side, None


def as_far_as_mass_says(sides: Sequence[Sequence[Step]], deviance: float) -> list[Erring]:
    """Return points of a valley, each at the deviance of a normal law with as much mass beyond.

    Parameters
    ----------
    sides : sequence of sequence of Step
        Both sides of a maximum, outwards.
    deviance : float
        Of the maximum.

    Returns
    -------
    list of Erring
        Where that is less than curvature foresees; of each side up to the first beyond two
        standard deviations.
    """
    each = [masses(side) for side in sides]
    whole = sum(float(mass.sum()) for mass in each)
    points: list[Erring] = []
    for side, mass in zip(sides, each, strict=True):
        beyond = np.cumsum(mass[::-1])[::-1][1:] / whole
        for step, share in zip(side, beyond.tolist(), strict=True):
            excess = max(float(stats.norm.isf(share)), 0.0) ** 2
            if not excess < _FLAT * step.away * step.away:
                continue
            points.append(dataclasses.replace(step.end, deviance=deviance + excess))
            if excess >= _ENOUGH:
                break
    return points


def masses(side: Sequence[Step]) -> Array:
    """Return the mass of one side up to each step and beyond the last, shape (steps + 1,).

    In standard deviations times the density at the maximum. The log density falls as a parabola to
    the first step, and along straight lines from step to step; beyond it goes on as before. Beyond
    an end of what is possible, or where a climb fails, half of what the last step holds.
    """
    if not side:
        return np.array([math.sqrt(0.5 * math.pi)])
    first, last = side[0], side[-1]
    fall = max(first.cost, 1e-3)
    root = math.sqrt(0.5 * fall)
    whole = first.away * math.sqrt(0.5 * math.pi / fall)
    found, beyond = [whole * math.erf(root)], whole * math.erfc(root)
    for before, after in itertools.pairwise(side):
        length, bend = after.away - before.away, 0.5 * (after.cost - before.cost)
        falls = math.exp(-0.5 * before.cost)
        found.append(length * falls * (-math.expm1(-bend) / bend if abs(bend) > 1e-9 else 1.0))
        beyond = math.exp(-0.5 * last.cost) / max(bend / length, 1.0 / last.away)
    return np.array([*found, beyond if _is_followed(last) else 0.5 * found[-1]])


def _is_followed(last: Step) -> bool:
    """Return whether a valley need not be followed beyond a step."""
    return last.cost >= min(_FLAT * last.away * last.away, _NOTHING)
