"""How far the frames show that the object moves, whatever the values of the unknowns.

While the range changes, the two readings of a frame run along a curve, and with every range
unknown that curve is all that frames tell: a point tells one number, a straight line two, and only
what bends tells more. Where noise hides the bend, a fit follows the noise of each frame with that
frame's own range; its likelihood then prefers curves that bend where nothing was seen, so that
neither its curvature nor its differences say how far such values are from the truth.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.multiframe.multistart import Optimum
from inference.multiframe.problem import FitProblem

__all__ = ["numbers_shown"]

Array = NDArray[np.float64]

_FALSE_ALARM = 1e-3  # of finding motion or a bend where there is none
_TURNS = 10  # of the line, whose weights depend on its direction


def numbers_shown(problem: FitProblem, top: Optimum) -> float:
    """Return how many numbers the frames with an object tell at most, as far as can be told.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Optimum
        Its best optimum, which gives the object's part of the readings: to it the relative error
        belongs.

    Returns
    -------
    float
        1 where they all read the same but for noise, 2 where they read along a straight line, inf
        where neither holds or frames differ in gain.
    """
    shown = problem.present & np.isfinite(top.positions)
    if not shown.any() or np.ptp(problem.frames[shown, 2]) > 0:
        return math.inf
    readings = problem.frames[shown, :2]
    covariance = _covariances(problem, top, shown)
    miss = readings - readings.mean(axis=0)
    white = np.linalg.solve(np.linalg.cholesky(covariance), miss[:, :, None])
    if np.square(white).sum() < special.chdtri(2 * max(len(miss) - 1, 1), _FALSE_ALARM):
        return 1.0
    if len(miss) > 2 and _off_a_line(readings, covariance) < special.chdtri(
        len(miss) - 2, _FALSE_ALARM
    ):
        return 2.0
    return math.inf


def _covariances(problem: FitProblem, top: Optimum, shown: NDArray[np.bool_]) -> Array:
    """Return the covariance of the readings of every frame that is shown, (m, 2, 2)."""
    r0, wave, read, shot, relative = problem.instrument
    frames = problem.frames[shown]
    light = (shot or 0.0) * np.abs(frames[:, :2])
    out = np.zeros((len(frames), 2, 2))
    out[:, 0, 0], out[:, 1, 1] = (np.square(read) + light).T
    if wave is None:
        out[:, 0, 1] = out[:, 1, 0] = light.min(axis=1)
    if relative:
        c0, c1, c2 = problem.values(top.x)[:3]
        r = np.exp(top.positions[shown])
        size = problem.gain * frames[:, 2] * c0 * c2 / (r * r * (r * (r + c1) + c0))
        if wave is None:
            carrier = np.stack([np.minimum(r / r0, 1.0), np.ones_like(r)], axis=1)
        else:
            phase = wave[0] * r + wave[1]
            carrier = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        signal = relative * size[:, None] * carrier
        out += signal[:, :, None] * signal[:, None, :]
    return out


def _off_a_line(readings: Array, covariance: Array) -> float:
    """Return the chi-square of the readings' distances from the straight line nearest to them."""
    # in units of the mean noise a line's weights hardly depend on its direction
    root = np.linalg.cholesky(covariance.mean(axis=0))
    white = np.linalg.solve(root, readings.T).T
    unit = np.linalg.solve(root, np.linalg.solve(root, covariance).transpose(0, 2, 1))
    weight, least = np.ones(len(white)), math.inf
    for _ in range(_TURNS):
        miss = white - np.average(white, axis=0, weights=weight)
        across = np.linalg.eigh(np.einsum("n,ni,nj->ij", weight, miss, miss))[1][:, 0]
        weight = 1.0 / np.einsum("i,nij,j->n", across, unit, across)
        least = min(least, float(weight @ np.square(miss @ across)))
    return least
