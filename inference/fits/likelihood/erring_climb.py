"""Climbs over unknowns, ranges and errors of the model (docs/model.md, fit-response)."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.erring_point import (
    Point,
    left_of_frames,
    point_at,
    standard,
    standard_and_slopes,
)
from inference.fits.likelihood.frame_modes import frame_modes
from inference.fits.likelihood.model_error import number_of_errors
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import eliminated
from inference.fits.likelihood.triangle import triangle_of
from inference.frame.sensitivity import Value
from inference.identifiability.information import Information

__all__ = ["FEW", "Pull", "begun", "climbed", "held_within_priors", "with_other_ranges"]

Array = NDArray[np.float64]

FEW = 6  # steps of every climb
_INWARD = 1.5  # standard deviations of the priors that a second start is held within
_LONGEST = 0.7  # change of a logarithm in a step
_TURNS = 2  # in which ranges and errors settle at given unknowns
_ENOUGH = 1e-3  # of what is gained by a step
_FAR = 36.0  # chi-square of a frame whose range may be another one
_OF_WORST = 1e-2  # of the worst frame's, beside which others may only have followed it
_ROUNDS = 3
_REST = 0.75  # of the frames, whose ranges stay


def held_within_priors(problem: FitProblem, x: Array) -> Array:
    """Return coordinates that are nowhere far out in the priors."""
    columns = problem.columns
    z = np.zeros((1, len(columns)))
    z[0, columns] = np.clip(standard(problem, x[None]), -_INWARD, _INWARD)
    if problem.mode is not None:
        z = problem.mode.centre + z @ problem.mode.factor.T
    return np.asarray(problem.coordinates(problem.parameters.natural(z)[:, columns])[0])


def _eliminated(problem: FitProblem, at: Point) -> Information:
    """Return rows across the ranges; of the errors, and last of the residuals."""
    errors = np.concatenate([at.errors, at.residual[:, :, None]], axis=2)
    told = at.told
    if told is not None:
        of_all = np.concatenate([told.errors, told.residual[:, :, None]], axis=2)
        told = told._replace(errors=of_all)
    seen = eliminated(problem.names, at.jacobian, at.along, errors, told)
    # what a range would gain beyond the ends of what is possible no step can take
    low, high = problem.log_ends(at.x)
    step = -seen.error_response[:, -1]
    nearest = (at.u <= low) & (step < 0.0)
    ended = nearest | ((at.u >= high) & (step > 0.0))
    if not ended.any():
        return seen
    along, jacobian = np.where(ended[:, None], 0.0, at.along), at.jacobian
    if told is not None:
        told = told._replace(along=np.where(ended[:, None], 0.0, told.along))
    if not low > problem.log_support[0]:
        return eliminated(problem.names, jacobian, along, errors, told)
    # the nearest that a shadow allows moves with it, and such ranges with that
    values, chain = problem.opened(at.x)
    moves = nearest[:, None] * chain[Value.SHADOW_C1] / values[Value.SHADOW_C1]
    followed = np.where(nearest[:, None], at.along, 0.0)[:, :, None] * moves[:, None, :]
    seen = eliminated(problem.names, jacobian + followed, along, errors, told)
    return dataclasses.replace(
        seen,
        response=np.where(nearest[:, None], moves, seen.response),
        own_variance=np.where(nearest, 0.0, seen.own_variance),
    )


def _solved(triangle: Array, wanted: Array) -> Array:
    """Solve for errors, whose own law keeps the triangle from being singular."""
    return np.asarray(scipy.linalg.solve_triangular(triangle, wanted, check_finite=False))


def _ranges(problem: FitProblem, at: Point, seen: Information, x: Array, da: Array) -> Array:
    """Return ranges that follow a step to x."""
    step = seen.response @ (x - at.x) + seen.error_response @ np.append(da, -1.0)
    with np.errstate(invalid="ignore"):
        step = np.minimum(np.maximum(step / (1.0 + seen.own_variance), -0.5), 0.5)
    step[~np.isfinite(step)] = 0.0
    low, high = problem.log_ends(x)
    u = np.minimum(np.maximum(at.u + step, low), high)
    return np.where(np.isfinite(at.u), u, np.nan)


def _settled(problem: FitProblem, at: Point) -> Point:
    """Let ranges and errors follow the unknowns, which stay."""
    k = at.a.size
    for _ in range(_TURNS):
        if not math.isfinite(at.deviance):
            break
        seen, da = _eliminated(problem, at), np.zeros(k)
        if k > 0:
            rows = np.vstack([seen.errors, np.column_stack([np.eye(k), -at.a])])
            triangle = triangle_of(rows)
            da = _solved(triangle[:k, :k], triangle[:k, k])
        u = _ranges(problem, at, seen, at.x, da)
        at = point_at(problem, at.x, u, at.a + da, at.z)
    return at


def begun(problem: FitProblem, x: Array, positions: Array) -> Point:
    """Return a start with errors that follow from it, and ranges that follow these."""
    u = np.where(problem.present & np.isnan(positions), math.log(problem.support[1]), positions)
    if problem.known is not None:
        value = np.clip(problem.known.values[:, 0], *problem.support)
        u = np.where(problem.known.rates[:, 0] > 0, np.log(value), u)
    none = np.zeros(number_of_errors(problem))
    return _settled(problem, _settled(problem, point_at(problem, x, u, none)))


class Pull(NamedTuple):
    """Where a weighted sum of log ranges is pulled to in a climb, and how strongly.

    Attributes
    ----------
    weights : ndarray, shape (n,)
        Of the frames; 0 of one without a range.
    target : float
        Of the sum.
    strength : float
        One over how far it may stay off, a standard deviation.
    """

    weights: Array
    target: float
    strength: float

    def off(self, u: Array) -> float:
        """Return how far ranges are off it, in standard deviations."""
        return self.strength * (self.target - self.sum_of(u))

    def sum_of(self, part: Array) -> float:
        """Return the weighted sum over the frames."""
        return float(self.weights @ np.where(self.weights != 0.0, part, 0.0))

    def row(self, seen: Information, u: Array) -> Array:
        """Return it as a row beside those of readings: errors, unknowns and what is left."""
        moved = np.concatenate([seen.error_response[:, :-1], seen.response], axis=1)
        moved = self.weights @ np.where(self.weights[:, None] != 0.0, moved, 0.0)
        ahead = self.sum_of(seen.error_response[:, -1])
        return np.append(self.strength * moved, self.off(u) + self.strength * ahead)


def climbed(
    problem: FitProblem, at: Point, steps: int, held: int | None = None, pull: Pull | None = None
) -> tuple[Point, float]:
    """Climb by Levenberg-Marquardt steps of the unknowns, ranges and errors following.

    One of the unknowns may be held, or the ranges be pulled elsewhere. Returns also the deviance
    that a whole step would still gain.
    """
    k, damping, remaining = at.a.size, 1e-3, math.inf
    slopes = standard_and_slopes(problem, at.x)[1]
    for _ in range(steps if math.isfinite(at.deviance) else 0):
        seen, bounds = _eliminated(problem, at), problem.bounds(at.x)
        errors, seen_residual = seen.errors[:, :-1], seen.errors[:, -1]
        d = at.x.size
        m = len(errors)
        rows = np.zeros((m + k + d, k + d + 1))
        rows[:m, :k], rows[:m, k:-1], rows[:m, -1] = errors, seen.jacobian, seen_residual
        rows[m : m + k, :k], rows[m : m + k, -1] = np.eye(k), -at.a
        rows[m + k :, k:-1], rows[m + k :, -1] = slopes, -at.z
        if pull is not None:
            rows = np.vstack([rows, pull.row(seen, at.u)])
        triangle = triangle_of(rows)
        of_x, wanted = triangle[k : k + d, k:-1], triangle[k : k + d, -1]
        if held is not None:
            of_x = np.where(np.arange(d) == held, 0.0, of_x)
        size = np.sqrt(np.square(of_x).sum(axis=0))
        size = np.where(size > 0, size, 1.0)
        remaining = float(wanted @ wanted)
        better = None
        for _ in range(8):
            damped = np.vstack([of_x / size, math.sqrt(damping) * np.eye(d)])
            step = np.linalg.lstsq(damped, np.append(wanted, np.zeros(d)), rcond=None)[0] / size
            longest = float(np.abs(step[problem.logarithms]).max(initial=0.0))
            new = np.clip(at.x + step * min(1.0, _LONGEST / max(longest, 1e-300)), *bounds)
            dx = new - at.x
            left = triangle[:k, -1] - triangle[:k, k:-1] @ dx
            da = np.zeros(0)
            if k > 0:
                da = _solved(triangle[:k, :k], left)
            z, slopes_there = standard_and_slopes(problem, new)
            u = _ranges(problem, at, seen, new, da)
            there = _settled(problem, point_at(problem, new, u, at.a + da, z))
            if math.isfinite(there.deviance):
                gained = at.deviance - there.deviance_weighted_as(at)
                if pull is not None:
                    gained += pull.off(at.u) ** 2 - pull.off(there.u) ** 2
                if gained > 0.0:
                    better = there
                    break
            damping *= 6.0
        if better is None:
            break
        at, slopes, damping = better, slopes_there, max(damping / 4.0, 1e-9)
        if gained < _ENOUGH:
            break
    return at, remaining


def _left(problem: FitProblem, at: Point) -> Array:
    """Return chi-squares of frames across their ranges."""
    none = np.zeros((at.u.size, 2, 1))
    return np.nan_to_num(left_of_frames(problem, at.u, at.residual, at.along, none, none))


def with_other_ranges(problem: FitProblem, at: Point, x: Array, positions: Array) -> Point:
    """Climb again without frames that are far off, and give them ranges that fit what is found.

    A start has the range of a frame that its unknowns prefer, which errors may turn into another
    mode, from where no climb comes back: it bends everything else towards that frame instead.

    Parameters
    ----------
    at : Point
        The end of a climb.
    x, positions : ndarray, shape (d,), (n,)
        Its start.

    Returns
    -------
    Point
        Where the climb of all frames then ends; what is given where no frame is far off, or most.
    """
    stay, part = np.ones(at.u.size, dtype=np.bool_), at
    left = _left(problem, at)
    for _ in range(_ROUNDS):
        far = left > max(_FAR, _OF_WORST * float(left.max()))
        stay[np.flatnonzero(stay)[far]] = False
        if not far.any() or np.count_nonzero(stay) < _REST * stay.size:
            break
        rest = problem.select(np.flatnonzero(stay))
        part, _ = climbed(rest, begun(rest, x, positions[stay]), FEW)
        left = _left(rest, part)
    if stay.all() or np.count_nonzero(stay) < _REST * stay.size or (left > _FAR).any():
        return at
    others = problem.select(np.flatnonzero(~stay))
    best, least = at.u[~stay], np.full(others.present.size, np.inf)
    for u in frame_modes(others, part.x)[0].T:
        if not np.isfinite(u).any():
            break
        u = np.where(np.isfinite(u), u, best)
        there = _settled_ranges(others, point_at(others, part.x, u, part.a))
        cost = np.square(there.residual).sum(axis=1)
        best, least = np.where(cost < least, there.u, best), np.fmin(cost, least)
    u = at.u.copy()
    u[stay], u[~stay] = part.u, best
    return climbed(problem, _settled(problem, point_at(problem, part.x, u, part.a)), FEW)[0]


def _settled_ranges(problem: FitProblem, at: Point) -> Point:
    """Let ranges follow unknowns and errors, which stay."""
    for _ in range(_TURNS):
        seen = _eliminated(problem, at)
        u = _ranges(problem, at, seen, at.x, np.zeros(at.a.size))
        at = point_at(problem, at.x, u, at.a, at.z)
    return at
