"""Where climbs begin that no screen of the unknowns finds (docs/model.md, fit-response)."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK
from inference.fits.likelihood.conditional_fit import conditional, unconditional
from inference.fits.likelihood.erring_climb import begun
from inference.fits.likelihood.erring_point import Point
from inference.fits.likelihood.frame_modes import frame_modes
from inference.fits.likelihood.maximum import Maximum, approach
from inference.fits.likelihood.problem import FitProblem

__all__ = ["apart", "larger", "of_law", "other_crosstalk"]

Array = NDArray[np.float64]

_AT_EDGE = 1e-6  # of log r
_SQUARES = ("object.c0", "object.c2", "background.shadow.c0")  # of lengths; their logs are unknowns
_APART = 0.1  # of log r of a frame, from which on points are two places
_LARGER = 4.0
_STEPS = 30  # of a climb with crosstalk held
# of what the brightest frame has more than the darkest: as if that were 5.9, 3.3 and 2.1 times as
# far away by an inverse square, 2.4, 1.8 and 1.4 times by the fourth power
_LIGHT_LEFT = (0.03, 0.1, 0.3)


def apart(points: Iterable[Point]) -> list[Point]:
    """Return points in the same order, those last whose ranges all lie near those of another.

    Most starts come to the same few places: of the best alone none may be at the best place of all.

    Parameters
    ----------
    points : iterable of Point
        Ends of short climbs, the best first.

    Returns
    -------
    list of Point
    """
    first: list[Point] = []
    last: list[Point] = []
    for at in points:
        alike = any(np.nanmax(np.abs(at.u - one.u), initial=0.0) < _APART for one in first)
        (last if alike else first).append(at)
    return first + last


def of_law(problem: FitProblem) -> list[Maximum]:
    """Return the centre of the scene's joint law, or of the mode that is taken, as a start.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.

    Returns
    -------
    list of Maximum
        One, or none where the scene has no joint law.
    """
    if not problem.law:
        return []
    z = np.zeros((1, len(problem.parameters)))
    if problem.mode is not None:
        z = problem.mode.centre[None]
    natural = problem.parameters.natural(z)[:, problem.columns]
    x = problem.coordinates(natural)[0]
    return [Maximum(x, 0.0, math.inf, frame_modes(problem, x)[0][:, 0])]


def other_crosstalk(problem: FitProblem, softer: FitProblem) -> list[Maximum]:
    """Return starts whose crosstalk leaves the darkest frame some light of the object.

    A fainter object behind more crosstalk explains frames as well, until the darkest frame is
    crosstalk alone; noise that is in proportion to light pulls starts of softened problems there.
    Half of what that frame reads is one start. Others are beyond the frame that differs
    most from the brightest, by shares of what these two differ: crosstalk may be negative.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    softer : FitProblem
        The same with more noise.

    Returns
    -------
    list of Maximum
        None where crosstalk is known, or all that is unknown.
    """
    sides = np.flatnonzero(np.isin(problem.slots, CROSSTALK)).tolist()
    if len(sides) < len(CROSSTALK) or len(problem) == len(sides):
        return []
    light = problem.frames[problem.present, :2]
    dark = light[np.argmin(np.hypot(light[:, 0], light[:, 1]))]
    bright = light[_farthest(light, np.median(light, axis=0))]
    darkest = light[_farthest(light, bright)]  # crosstalk may be negative
    middle = problem.parameters.natural(np.zeros((1, len(problem.parameters))))
    x = problem.coordinates(middle[:, problem.columns])[0]
    found = []
    for crosstalk in (0.5 * dark, *(darkest - share * (bright - darkest) for share in _LIGHT_LEFT)):
        x[sides] = crosstalk
        found.append(_behind(problem, softer, sides, x))
    return found


def _farthest(light: Array, of: Array) -> int:
    return int(np.argmax(np.square(light - of).sum(axis=1)))


def _behind(problem: FitProblem, softer: FitProblem, sides: list[int], x: Array) -> Maximum:
    """Climb with crosstalk held where it is at x."""
    # the last first: the places of the others stay
    first, rest = conditional(softer, sides[1], np.clip(x, *problem.bounds(x)))
    second, rest = conditional(first, sides[0], rest)
    found = approach(second, rest, _STEPS)
    x = unconditional(problem, first, unconditional(first, second, found.x))
    return Maximum(x, found.deviance, math.inf, found.positions)


def larger(problem: FitProblem, at: Point) -> list[Point]:
    """Return a larger scene as a start, where one is as small as ranges may be.

    Of an object that is larger in all its lengths the light is the same at ranges that are as much
    larger. Light decides more quickly than its delay, so a climb may take a scene for too small,
    until a range meets the least that is possible and holds all the others.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    at : Point
        The best end of a climb.

    Returns
    -------
    list of Point
        One, or none where no range is at its least, or the object is known.
    """
    nearest, farthest = np.log(problem.support)
    if not ((at.u < nearest + _AT_EDGE).any() and {"object.c0", "object.c2"} <= {*problem.names}):
        return []
    more = math.log(_LARGER)
    powers = np.array([2.0 * (name in _SQUARES) for name in problem.names])
    x = np.clip(at.x + powers * more, *problem.bounds(at.x))
    begin = begun(problem, x, np.minimum(at.u + more, farthest))
    return [begin] if math.isfinite(begin.deviance) else []
