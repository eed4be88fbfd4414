"""Motion that the rate's law does not foresee, where crosstalk is learnt.

Range and crosstalk are told apart by how an object moves, so that motion which is unlikely as it is
stated is rather taken for another crosstalk, a little more with every stop and every start. There
the law of the rate is wider than it is stated. A step that even this finds surprising may be a
turn: the hypothesis is then as unsure of its motion as the step is long, and as much less likely as
the step is surprising, which is the tail of a Cauchy law.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import Prior
from inference.tracking.hypotheses import Hypotheses, U, unknown_crosstalk
from inference.tracking.motion import Motion
from inference.tracking.readings_table import ReadingsTable, mean_at
from inference.tracking.resting import nothing_has_changed
from inference.tracking.roots import Root
from inference.tracking.square_root import move
from inference.tracking.stillness import is_still
from simulator.compiled import compiled

__all__ = ["may_turn", "widening"]

Array = NDArray[np.float64]

_AT_REST = 0.1  # of it, while nothing has changed since the first frame
_WIDER = 3.0  # times that is stated: the rate's standard deviation, where crosstalk is not known
# variances of a reading by crosstalk, and by the motion until the next frame, in that of the noise,
# at which either is half of the way to that
_HALF = 1.0
_SURPRISING = 1.5  # standard deviations of a step from which on it may be a turn


@compiled
def widening(of: Hypotheses, row: int, reach: float, table: ReadingsTable) -> float:
    """Return how many times as wide as stated the law of the rate is for one hypothesis.

    Crosstalk that is known better than a frame's noise cannot take up what motion does, and where
    frames tell no more of the range than the motion before them it is the motion that holds it.
    While nothing has changed since the first frame the law is narrower than stated: the motion as
    it is stated has to go somewhere, and hypotheses of an object at rest would move on to where the
    curve is flat.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis.
    reach : float
        Standard deviation of the change of log r until the next frame, by the rate as stated.
    table : ReadingsTable
        Mean readings.
    """
    unknown = unknown_crosstalk(of, row)
    if is_still(of) and nothing_has_changed(of):
        return 1.0 - (1.0 - _AT_REST) * unknown / (unknown + _HALF)
    _, _, slope1, slope2 = mean_at(of.x[row, U], table)
    seen = (slope1 * slope1 + slope2 * slope2) * reach * reach
    return 1.0 + (_WIDER - 1.0) * unknown / (unknown + _HALF) * seen / (seen + _HALF)


@borrowed
@compiled
def may_turn(
    of: Hypotheses, row: int, mode: float, prior: Prior, seconds: float, work: Array
) -> float:
    """Make a hypothesis as unsure of its motion as the step to a mode is long.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis as it was predicted; changed in place where the step is surprising.
    mode : float
        log r of its heaviest candidate.
    prior : Prior
        What it says of the frame.
    seconds : float
        Since the frame before [s].
    work : ndarray
        As in `Scratch`.

    Returns
    -------
    float
        The step in standard deviations, where it is surprising: a turn is as much less likely.
        Otherwise 0.
    """
    # what it errs with the crosstalk is no motion
    own = 1.0 - prior.share
    away = own * (mode - prior.position.centre)
    variance = own / prior.position.precision
    if not (seconds > 0.0 and away * away > _SURPRISING * _SURPRISING * variance > 0.0):
        return 0.0
    noise = math.sqrt(away * away - variance)
    move(of, row, Motion(0.0, 1.0, Root(noise, 0.0, noise / seconds), 0.0, 0.0), work)
    return float(abs(away) / math.sqrt(variance))
