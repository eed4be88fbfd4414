"""How far the frames show that the object moves, whatever the values of the unknowns.

While the range changes, the two readings of a frame run along a curve, and with every range
unknown that curve is all that frames tell: a point tells one number, a straight line two, and only
what bends tells more. Where noise hides the bend, a fit follows the noise of each frame with that
frame's own range; its likelihood then prefers curves that bend where nothing was seen, so that
neither its curvature nor its differences say how far such values are from the truth.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.problem import FitProblem
from inference.frame.noise import covariances, whiteners
from inference.frame.sensitivity import Value
from simulator.readings import object_readings

__all__ = ["numbers_shown"]

Array = NDArray[np.float64]

_FALSE_ALARM = 1e-3  # of finding motion or a bend where there is none
_TURNS = 10  # of the line, whose weights depend on its direction


def numbers_shown(problem: FitProblem, top: Maximum) -> float:
    """Return how many numbers the frames with an object tell at most, as far as can be told.

    Parameters
    ----------
    top : Maximum
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
    signal = _signal(problem, top, shown)
    if not np.isfinite(signal).all():
        return math.inf
    freedom = 2 * max(len(readings) - 1, 1)
    miss = readings - readings.mean(axis=0)
    white = np.einsum("nij,nj->ni", whiteners(problem.instrument, readings, signal), miss)
    if np.square(white).sum() < scipy.special.chdtri(freedom, _FALSE_ALARM):
        return 1.0
    if len(readings) < 3:
        return 2.0
    read = np.asarray(problem.instrument.read)
    covariance = covariances(problem.instrument, readings, signal) / read / read[:, None]
    off = _off_a_line(readings / read, covariance)
    return 2.0 if off < scipy.special.chdtri(len(readings) - 2, _FALSE_ALARM) else math.inf


def _signal(problem: FitProblem, top: Maximum, shown: NDArray[np.bool_]) -> Array:
    """Return the object's part of the readings, shape (m, 2)."""
    c0, c1, c2 = problem.values(top.x)[: Value.CROSSTALK_1].tolist()
    r0, wave = problem.instrument.r0, problem.instrument.wave
    strengths = problem.gain * problem.frames[shown, 2] * c0 * c2
    ranges = np.exp(top.positions[shown])
    return np.array(
        [
            object_readings(r, r0, wave, strength, c0, c1)
            for r, strength in zip(ranges.tolist(), strengths.tolist(), strict=True)
        ]
    )


def _off_a_line(readings: Array, covariance: Array) -> float:
    """Return the chi-square of the readings' distances from the straight line nearest to them.

    All in units of the read noise, in which a line's weights hardly depend on its direction.
    """
    weight, least = np.ones(len(readings)), math.inf
    for _ in range(_TURNS):
        miss = readings - np.average(readings, axis=0, weights=weight)
        # the direction with the least weighted variance, which no sum of squares loses
        across = np.linalg.svd(np.sqrt(weight)[:, None] * miss, full_matrices=False)[2][1]
        variance = np.einsum("i,nij,j->n", across, covariance, across)
        weight = 1.0 / variance
        least = min(least, float(weight @ np.square(miss @ across)))
    return least
