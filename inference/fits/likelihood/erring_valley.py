"""Valleys of the likelihood where the model errs: how far they reach beyond what curvature says.

Few frames that tell little leave long valleys that are flat, and a narrow optimum somewhere beside
them: curvature there says a width that is a tenth of what the deviance says, and the truth was seen
19 standard deviations off at a deviance of 2. So from every optimum that is nearly as good as the
best, each unknown is held away on both sides while everything else follows, for as long as the
deviance rises by less than curvature foresees, and as far as two standard deviations cost.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.frame_modes import nearest_modes
from inference.fits.likelihood.problem import FitProblem

__all__ = ["near", "valleys"]

_STEPS = 8  # of a climb with an unknown held
_FIRST = 2.0  # standard deviations to where an unknown is held first
_ENOUGH = 4.0  # deviance that two standard deviations cost
_FLAT = 0.5  # of the deviance that curvature foresees, below which a valley is followed
_DOUBLINGS = 6
_BASES = 3  # optima whose valleys are followed
_ONE = 0.1  # standard deviations between two ends that are one
_APART = 0.1  # of log r of a frame, from which on they are two
_STRIDE = 1.0  # most that a logarithm is moved at once
_BETTER = 0.05  # deviance by which another optimum is better


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
        for sign in (1.0, -1.0):
            ahead = sign * of_x @ of_x[j] / sds[j]
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
                        return points, end_of(problem, end, remaining)
                if cost < -_BETTER:  # the valley of a maximum that is known, and counts by itself
                    break
                away = abs(float(at.x[j] - base.x[j])) / sds[j]
                if cost >= _FLAT * away * away:
                    break
                points.append(end_of(problem, at, 0.0))
                if cost >= _ENOUGH:
                    break
                x, positions, before, reach = at.x, at.u, reach, 2.0 * reach
    return points, None
