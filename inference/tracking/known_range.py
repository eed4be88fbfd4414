"""What is known of a frame's range beside its readings: one more reading, of the range itself.

Densities are relative to their top, which is the same for all explanations of a frame.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame, log_known
from inference.tracking.hypotheses import Hypotheses, Scratch, U, learns_crosstalk
from inference.tracking.readings_table import LOG_PRIOR, ReadingsTable, cell_of
from inference.tracking.shared_error import NOT_SHARED, follow, shared_of
from inference.tracking.square_root import update_range
from simulator.compiled import compiled

__all__ = ["beyond_support", "known_of_hypothesis", "known_of_new", "take_known"]

Array = NDArray[np.float64]

_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)
_OUTSIDE = 5.0  # standard deviations by which a known range may lie off the possible ones


def beyond_support(known: Array, sd: Array, table: ReadingsTable) -> NDArray[np.int64]:
    """Return the indices of known ranges that lie where no range is possible."""
    low, high = math.exp(table.start), math.exp(table.end)
    with np.errstate(invalid="ignore"):
        off = np.maximum(low - known, known - high) > _OUTSIDE * sd
    return np.flatnonzero(off).astype(np.int64)


@borrowed
@compiled
def take_known(
    of: Hypotheses,
    row: int,
    u: float,
    new: bool,
    frame: TrackedFrame,
    table: ReadingsTable,
    scratch: Scratch,
) -> float:
    """Teach a hypothesis the range that is known of a frame, linear at u; its surprise.

    Where crosstalk is learnt, a range far from the prediction says where on the curve the object
    is. The crosstalk goes there along the curve, not along its tangent, with all that frames have
    told of the readings kept: nuisance parameters stay what they are.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; changed in place.
    u : float
        log r at which the range is taken.
    new : bool
        Whether the object has just come: its range has nothing in common with the crosstalk.
    frame : TrackedFrame
        Of known range.
    table : ReadingsTable
        Mean readings.
    scratch : Scratch
        Overwritten.

    Returns
    -------
    float
        Normalised innovation squared.
    """
    along = learns_crosstalk(of) and not new
    shared = shared_of(of, row) if along else NOT_SHARED
    slope = math.exp(u) * frame.known_rate
    residual = frame.known_m * frame.known_rate - slope * (1.0 + of.x[row, U] - u)
    surprise = update_range(of, row, residual, slope, scratch)
    if along:
        follow(of, row, shared, frame.gain, table)
    return surprise


@borrowed
@compiled
def known_of_hypothesis(of: Hypotheses, row: int, frame: TrackedFrame) -> tuple[float, float]:
    """Return the log of how likely a known range is under a hypothesis, and the best log r.

    Laplace's method about the mode, which lies between what was predicted and what is known.
    """
    X, centre = of.X, of.x[row, U]
    variance = 0.0
    for j in range(X.shape[-1]):
        variance += X[row, U, j] * X[row, U, j]
    variance = max(variance, 1e-300)
    known = math.log(frame.known_m)
    low, high = min(centre, known), max(centre, known)
    u, curvature = known, 0.0
    for _ in range(60):
        r = math.exp(u) * frame.known_rate
        off = r - frame.known_m * frame.known_rate
        slope = -(u - centre) / variance - off * r
        # off is at most what lies between both: the information alone is positive everywhere
        curvature = 1.0 / variance + r * r
        if slope > 0.0:
            low = u
        else:
            high = u
        step = slope / curvature
        if abs(step) * math.sqrt(curvature) < 1e-6 or high - low < 1e-15 * (1.0 + abs(u)):
            break
        trial = u + step
        u = trial if low < trial < high else 0.5 * (low + high)
    away = u - centre
    log_mass = -0.5 * away * away / variance + log_known(u, frame)
    return log_mass - 0.5 * math.log(variance * curvature), u


@borrowed
@compiled
def known_of_new(frame: TrackedFrame, table: ReadingsTable) -> tuple[float, float]:
    """Return the same of an object that has just come: its range has the prior of all ranges."""
    u = min(max(math.log(frame.known_m), table.start), table.end)
    i, t = cell_of(u, table)
    low, high = table.knots[i, LOG_PRIOR], table.knots[i + 1, LOG_PRIOR]
    width = math.log(frame.known_rate) + u
    return low + t * (high - low) + _LOG_ROOT_2PI - width + log_known(u, frame), u
