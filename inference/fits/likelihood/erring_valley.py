"""Valleys of the likelihood where the model errs: how far they reach beyond what curvature says.

Few frames that tell little leave long valleys that are flat, and a narrow optimum somewhere beside
them: curvature there says a width that is a tenth of what the deviance says, and the truth was seen
19 standard deviations off at a deviance of 2. So from every optimum that is nearly as good as the
best, each unknown is held away on both sides while everything else follows, for as long as the
deviance rises by less than curvature foresees, and as far as two standard deviations cost.
"""

import math
from collections.abc import Sequence

import numpy as np

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.problem import FitProblem

__all__ = ["valleys"]

_STEPS = 8  # of a climb with an unknown held
_FIRST = 2.0  # standard deviations to where an unknown is held first
_ENOUGH = 4.0  # deviance that two standard deviations cost
_FLAT = 0.5  # of the deviance that curvature foresees, below which a valley is followed
_DOUBLINGS = 6
_BASES = 3  # optima whose valleys are followed
_ONE = 0.1  # standard deviations between two ends that are one
_STRIDE = 1.0  # most that a logarithm is moved at once
_BETTER = 0.05  # deviance by which another optimum is better


def valleys(problem: FitProblem, found: Sequence[Erring]) -> tuple[list[Erring], Erring | None]:
    """Follow the valleys that the best maxima lie in.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    found : sequence of Erring
        Its maxima, the best first.

    Returns
    -------
    (list of Erring, Erring or None)
        Points that are optimal but for one unknown, farther out than curvature has them at their
        deviance; and a better maximum, if one was met.
    """
    points: list[Erring] = []
    best = found[0].deviance
    bases: list[Erring] = []
    for base in (one for one in found if one.deviance - best < _ENOUGH):
        if len(bases) == _BASES or any(_near(base, other) for other in bases):
            continue
        bases.append(base)
        more, better = _valley(problem, base, best)
        points += more
        if better is not None:
            return points, better
    return points, None


def _near(one: Erring, other: Erring) -> bool:
    """Return whether two ends of climbs are one optimum, to a part of its standard deviations."""
    of_x, _ = other.whole.factors
    sds = np.linalg.norm(of_x, axis=1)
    return bool((np.abs(one.x - other.x) < _ONE * sds).all())


def _valley(problem: FitProblem, base: Erring, best: float) -> tuple[list[Erring], Erring | None]:
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
                at, _ = climbed(problem, begun(problem, start, positions), _STEPS, j)
                if not math.isfinite(at.deviance):
                    break
                if at.deviance < best - _BETTER:
                    end, remaining = climbed(problem, at, 5 * _STEPS)
                    if end.deviance < best - _BETTER:
                        return points, end_of(problem, end, remaining)
                away = abs(float(at.x[j] - base.x[j])) / sds[j]
                if at.deviance - base.deviance >= _FLAT * away * away:
                    break
                points.append(end_of(problem, at, 0.0))
                if at.deviance - best >= _ENOUGH:
                    break
                x, positions, before, reach = at.x, at.u, reach, 2.0 * reach
    return points, None
