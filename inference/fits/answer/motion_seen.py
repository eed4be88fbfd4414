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

from inference.fits.likelihood.multistart import Optimum
from inference.fits.likelihood.problem import FitProblem
from inference.fits.linear.weighted import whitener_of

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
        1 where they all read the same but for noise, 2 where they read along a straight line (two
        frames always do), inf where neither holds or frames differ in gain.
    """
    shown = problem.present & np.isfinite(top.positions)
    if not shown.any() or np.ptp(problem.frames[shown, 2]) > 0:
        return math.inf
    readings = problem.frames[shown, :2]
    own, signal = _noise(problem, top, shown)
    if not np.isfinite(signal).all():
        return math.inf
    freedom = 2 * max(len(readings) - 1, 1)
    miss = readings - readings.mean(axis=0)
    white = np.einsum("nij,nj->ni", whitener_of(own, signal[None]), miss)
    if np.square(white).sum() < special.chdtri(freedom, _FALSE_ALARM):
        return 1.0
    if len(readings) < 3:
        return 2.0
    read = np.asarray(problem.instrument[2])
    off = _off_a_line(readings / read, own / read / read[:, None], signal / read)
    return 2.0 if off < special.chdtri(len(readings) - 2, _FALSE_ALARM) else math.inf


def _noise(problem: FitProblem, top: Optimum, shown: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the readings' own covariances, (m, 2, 2), and their relative error, (m, 2)."""
    r0, wave, read, shot, relative = problem.instrument
    frames = problem.frames[shown]
    light = (shot or 0.0) * np.abs(frames[:, :2])
    own = np.zeros((len(frames), 2, 2))
    own[:, 0, 0], own[:, 1, 1] = (np.square(read) + light).T
    if wave is None:
        own[:, 0, 1] = own[:, 1, 0] = light.min(axis=1)
    c0, c1, c2 = problem.values(top.x)[:3]
    r = np.exp(top.positions[shown])
    with np.errstate(all="ignore"):
        size = problem.gain * frames[:, 2] * c0 * c2 / (r * r * (r * (r + c1) + c0))
    if wave is None:
        carrier = np.stack([np.minimum(r / r0, 1.0), np.ones_like(r)], axis=1)
    else:
        phase = wave[0] * r + wave[1]
        carrier = np.stack([np.cos(phase), np.sin(phase)], axis=1)
    return own, (relative or 0.0) * size[:, None] * carrier


def _off_a_line(readings: Array, own: Array, signal: Array) -> float:
    """Return the chi-square of the readings' distances from the straight line nearest to them.

    All in units of the read noise, in which a line's weights hardly depend on its direction.
    """
    weight, least = np.ones(len(readings)), math.inf
    for _ in range(_TURNS):
        miss = readings - np.average(readings, axis=0, weights=weight)
        # the direction with the least weighted variance, which no sum of squares loses
        across = np.linalg.svd(np.sqrt(weight)[:, None] * miss, full_matrices=False)[2][1]
        variance = np.einsum("i,nij,j->n", across, own, across) + np.square(signal @ across)
        weight = 1.0 / variance
        least = min(least, float(weight @ np.square(miss @ across)))
    return least
