"""How much wider the likelihood is than its curvature at the optimum says.

In a flat curved valley the Cramer-Rao bound at the optimum can be far too small: it belongs to the
place where noise has put the optimum. Here the unknown that moves the ranges' common scale most is
held at values farther and farther out, everything else is fitted anew, and the deviance tells how
far one standard deviation really reaches.
"""

import dataclasses
import math

import numpy as np

from inference.fits.likelihood.conditional_fit import conditional, unconditional
from inference.fits.likelihood.maximum import Maximum, maximum_from
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.information import Information

__all__ = ["BETTER", "inflation", "loosely_told", "shift_of"]


_LINEAR = 0.02  # standard deviation of all coordinates below which curvature tells everything
_DOUBLINGS = 7
_HALVINGS = 2  # of the last doubling, where it went too far
_HELD = 2  # unknowns that are held in turn
_ENOUGH = 4.0  # deviance that two standard deviations cost
_LEAST = 0.01  # below which rounding of an optimum counts
_FARTHEST = 1.0  # change of the mean log range beyond which nothing more need be known
BETTER = 0.05  # deviance by which another optimum is better
_STRIDE = 1.0  # most that a coordinate is moved ahead


def loosely_told(problem: FitProblem, facts: Information) -> bool:
    """Tell whether anything but crosstalk is so uncertain that curvature may not tell everything.

    Parameters
    ----------
    facts : Information
        At its best optimum.
    """
    return bool((facts.sd[problem.logarithms] >= _LINEAR).any())


def shift_of(problem: FitProblem, top: Maximum, facts: Information, other: Maximum) -> float:
    """Return how far other values shift the ranges, in standard deviations of their common scale.

    Parameters
    ----------
    facts : Information
        There, of full rank.
    other : Maximum
        Other values.
    """
    present = problem.present & np.isfinite(top.positions) & np.isfinite(other.positions)
    spread = float(np.linalg.norm(facts.response[present].mean(axis=0) @ facts.factor))
    shift = abs(float(np.mean(other.positions[present] - top.positions[present])))
    return shift / spread if spread > 0.0 else 0.0


def inflation(
    problem: FitProblem, top: Maximum, facts: Information
) -> tuple[float, list[Maximum], Maximum | None]:
    """Return by how much standard deviations of the ranges exceed those from curvature.

    Parameters
    ----------
    facts : Information
        There, of full rank.

    Returns
    -------
    (float, list of Maximum, Maximum or None)
        At least 1, and 1 where the unknowns are fixed so well that curvature tells everything;
        points of the walk, optimal but for one unknown each; and a better optimum, if the walk met
        one.
    """
    points: list[Maximum] = []
    if len(problem) < 2 or not loosely_told(problem, facts):
        return 1.0, points, None
    present = problem.present & np.isfinite(top.positions)
    mean = facts.response[present].mean(axis=0)
    along = facts.factor @ (facts.factor.T @ mean)
    spread = math.sqrt(max(float(mean @ along), 0.0))
    if not spread > 0.0:
        return 1.0, points, None
    order = np.argsort(-np.abs(along) / facts.sd, kind="stable")
    widest = 1.0
    for j in order[:_HELD].tolist():
        for sign in (1.0, -1.0):
            ratio, walked, better = _walk(problem, top, facts, j, sign)
            if better is not None:
                return widest, points, better
            widest = max(widest, ratio / spread)
            points += walked
    return widest, points, None


def _walk(
    problem: FitProblem, top: Maximum, facts: Information, j: int, sign: float
) -> tuple[float, list[Maximum], Maximum | None]:
    """Hold one unknown farther and farther out; the shift of the ranges a standard deviation."""
    points: list[Maximum] = []
    present = problem.present & np.isfinite(top.positions)
    sd = float(facts.sd[j])
    # where the others go meanwhile, as far as curvature knows
    ahead = sign * facts.factor @ facts.factor[j] / sd
    x, widest = top.x + np.clip(ahead, -_STRIDE, _STRIDE), 0.0
    near, far, reach, halvings = 0.0, math.inf, 1.0, 0
    for _ in range(_DOUBLINGS):
        start = x.copy()
        start[j] = top.x[j] + sign * min(reach * sd, _STRIDE * reach)
        smaller, rest = conditional(problem, j, start)
        found = maximum_from(smaller, rest)
        if not math.isfinite(found.deviance):
            break
        cost = found.deviance - top.deviance
        if cost < -BETTER:
            better = maximum_from(problem, unconditional(problem, smaller, found.x))
            return widest, points, better if better.deviance < top.deviance else None
        shift = abs(float(np.mean(found.positions[present] - top.positions[present])))
        whole = unconditional(problem, smaller, found.x)
        points.append(dataclasses.replace(found, x=whole))
        if cost > _LEAST:
            widest = max(widest, shift / math.sqrt(cost))
        if shift > _FARTHEST or _ENOUGH <= cost < 2.0 * _ENOUGH:
            break
        if cost < _ENOUGH:
            near, x = reach, whole
        else:
            far, halvings = reach, halvings + 1
        if halvings > _HALVINGS:
            break
        # at a wall of the deviance most of the way is covered just before it
        reach = 2.0 * near if math.isinf(far) else 0.5 * (near + far)
    return widest, points, None
