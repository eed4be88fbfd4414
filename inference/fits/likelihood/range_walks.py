"""How far what ranges share reaches where priors decide it, everything else following.

A range is told through all unknowns, along valleys that bend: curvature at the top says how wide
they are there. So the sums of log ranges that the unknowns move most are pulled away from every
optimum that is nearly as good as the best, on both sides, until that costs three standard
deviations (docs/model.md, fit-priors). Held unknowns would say how far *these* reach.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import Pull, begun, climbed
from inference.fits.likelihood.maximum import DECIDED
from inference.fits.likelihood.problem import FitProblem

__all__ = ["range_walks", "shared_of", "sums_of"]

Array = NDArray[np.float64]

_NEARLY = 6.0  # of it, where a walk may end
_STEPS = 12  # of a climb with ranges pulled
_BEHIND = 60  # of one to a better optimum
_FIRST = 1.5  # standard deviations to where ranges are pulled first
_TIGHT = 10.0  # of a stride, how near they have to come
_MOST = 8  # strides of a walk
_LEAST, _LONGEST = 1.3, 2.0  # of a stride, in what is behind it
_NARROW = 0.2  # of the way, within which a wall is near enough
_STRIDE = 1.0  # most that a logarithm is moved ahead at once
_FARTHEST = 3.0  # in log r, beyond which nothing is told
_BASES = 3  # optima from which walks begin
_ONE = 0.1  # standard deviations between two optima that are one
_DIRECTIONS = 2  # sums that are pulled
_SHARE = 0.02  # of what the ranges share, below which a sum is none
_BETTER = 0.05  # deviance by which another optimum is better


def range_walks(problem: FitProblem, found: Sequence[Erring]) -> tuple[list[Erring], Erring | None]:
    """Walk along what the ranges share, from the best maxima.

    Parameters
    ----------
    problem : FitProblem
        The problem, with priors of the unknowns.
    found : sequence of Erring
        Its maxima, the best first.

    Returns
    -------
    (list of Erring, Erring or None)
        Points that are optimal but for where their ranges are pulled; and a better maximum, if one
        was met.
    """
    points: list[Erring] = []
    best, bases = found[0].deviance, 0
    behind: list[tuple[Array, Array]] = []
    for base in (one for one in found if one.deviance - best < DECIDED):
        shared = shared_of(base)
        u, sd = np.nan_to_num(base.positions), np.linalg.norm(shared, axis=1)
        if bases == _BASES or any((np.abs(u - v) <= _ONE * one).all() for v, one in behind):
            continue
        behind.append((u, sd))
        bases += 1
        for weights in sums_of(base, shared):
            for sign in (1.0, -1.0):
                more, better = _walk(problem, base, best, sign * weights)
                points += more
                if better is not None:
                    return points, better
    return points, None


def shared_of(base: Erring) -> Array:
    """Return what the ranges share at a maximum, in independent standard normal numbers, (n, m)."""
    of_x, of_errors = base.whole.factors
    moved = base.whole.response @ of_x + base.whole.error_response @ of_errors
    return np.asarray(np.where(np.isfinite(moved), moved, 0.0))


def sums_of(base: Erring, shared: Array) -> list[Array]:
    """Return weights, shape (n,), of the sums that most of what is shared is in, of variance 1."""
    own = base.whole.own_variance
    told = np.isfinite(base.positions) & np.isfinite(own)
    sd = np.sqrt(np.square(shared).sum(axis=1) + np.where(told, own, 0.0))
    told &= sd > 0.0
    # in proportion to its own standard deviation every frame counts the same
    size = np.where(told, 1.0 / np.where(told, sd, 1.0), 0.0)
    left, sizes, _ = np.linalg.svd(size[:, None] * shared, full_matrices=False)
    kept = np.square(sizes) > _SHARE * np.square(sizes).sum()
    sums = [size * left[:, k] for k in np.flatnonzero(kept)[:_DIRECTIONS]]
    return [np.asarray(weights / np.linalg.norm(weights @ shared)) for weights in sums]


def _walk(
    problem: FitProblem, base: Erring, best: float, weights: Array
) -> tuple[list[Erring], Erring | None]:
    """Pull a sum of unit variance farther and farther up."""
    points: list[Erring] = []
    of_x, _ = base.whole.factors
    ahead = of_x @ (weights @ shared_of(base))
    start = float(weights @ np.nan_to_num(base.positions))
    x, positions, near, far, reach = base.x, base.positions, 0.0, math.inf, _FIRST
    for _ in range(_MOST):
        step = (reach - near) * ahead
        longest = float(np.abs(step[problem.logarithms]).max(initial=0.0))
        begin = x + step * min(1.0, _STRIDE / max(longest, 1e-300))
        begin = np.clip(begin, *problem.bounds(x))
        pull = Pull(weights, start + reach, _TIGHT / (reach - near))
        at, _ = climbed(problem, begun(problem, begin, positions), _STEPS, pull=pull)
        if not at.deviance - best < DECIDED:  # a step ahead may lead into the dark
            again, _ = climbed(problem, begun(problem, x, positions), _STEPS, pull=pull)
            at = min(at, again, key=lambda end: end.deviance)
        if not math.isfinite(at.deviance):
            break
        if at.deviance < best - _BETTER:
            end, remaining = climbed(problem, at, _BEHIND)
            if end.deviance < best - _BETTER:
                return points, end_of(problem, end, remaining)
        cost = at.deviance - best
        if cost < DECIDED:
            points.append(end_of(problem, at, 0.0))
            stuck = pull.sum_of(at.u) - start < 0.5 * (near + reach)  # at an end of the ranges
            near, x, positions = reach, at.x, at.u
            moved = float(np.nanmax(np.abs(at.u - base.positions)))
            if cost > _NEARLY or moved > _FARTHEST or stuck:
                break
        else:
            far = reach
        if far - near < _NARROW * far:
            break
        if math.isinf(far):  # deviance grows by about the square of the way
            more = math.sqrt(0.5 * (_NEARLY + DECIDED) / max(cost, 1e-3))
            reach = near * min(max(more, _LEAST), _LONGEST)
        else:
            reach = 0.5 * (near + far)
    return points, None
