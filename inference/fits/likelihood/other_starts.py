"""Where climbs begin that no screen of the unknowns finds (docs/model.md, fit-response)."""

import math

import numpy as np

from inference.fits.likelihood.erring_climb import begun
from inference.fits.likelihood.erring_point import Point, columns_of
from inference.fits.likelihood.frame_modes import frame_modes
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.problem import FitProblem

__all__ = ["larger", "of_law"]

_AT_EDGE = 1e-6  # of log r
_SQUARES = ("object.c0", "object.c2", "background.shadow.c0")  # of lengths; their logs are unknowns
_LARGER = 4.0


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
    natural = problem.parameters.natural(z)[:, columns_of(problem)]
    x = problem.coordinates(natural)[0]
    return [Maximum(x, 0.0, math.inf, frame_modes(problem, x)[0][:, 0])]


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
