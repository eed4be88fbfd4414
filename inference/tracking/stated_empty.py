"""Frames that are stated to hold no object, where crosstalk is learnt: most of them are believed.

One of them may be an outlier, as any frame may be: a glitch, a hand before the sensor. It is passed
over where it contradicts what is held of the crosstalk. But what is held may be the outlier itself:
beside a wide prior the first of these frames is believed whatever it reads. So the frames that are
passed over and agree with one another are remembered as a rival, and the two are counted. More
frames win. While as many say the one as the other, or the last ones contradict what is held, nobody
knows, and the crosstalk is as wide as both.

docs/model.md, stated-empty, has the rule.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.empty_scene import Expected, expect_empty, learn_empty
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    COUNT,
    CROSSTALK1,
    CROSSTALK2,
    HELD,
    RIVAL,
    RIVAL1,
    RIVAL2,
    RIVAL_GAIN,
    RIVAL_TIME,
    RIVAL_VARIANCE,
    RUN,
    TIME,
    Hypotheses,
    Scratch,
    copy,
    learns_crosstalk,
    unknown_crosstalk,
)
from inference.tracking.merging import merge
from inference.tracking.motion import Motion, Rules
from inference.tracking.outliers import log_outlier
from inference.tracking.readings_table import FIRST, SECOND, ReadingsTable
from inference.tracking.report import CROSSTALK
from inference.tracking.roots import Root
from inference.tracking.square_root import Linear, move, update
from inference.tracking.without_object import take_stated, tell_all
from simulator.compiled import compiled

__all__ = ["describe_contradicted", "is_contradicted", "learn_stated", "open_crosstalk"]

Array = NDArray[np.float64]

_EVEN = 0.5  # probability of an outlier from which on a frame is passed over
# variance of a reading by crosstalk, in that of the noise, below which what is known of it before
# these frames counts as one of them
_TOLD = 10.0
_LAST = 2.0  # frames one after the other that are no outlier by chance


@compiled
def is_contradicted(of: Hypotheses) -> bool:
    """Tell whether frames stated empty leave open which of two crosstalks is right."""
    numbers = of.numbers
    if numbers[RIVAL] == 0.0:
        return False
    return bool(numbers[RIVAL] >= numbers[HELD] or numbers[RUN] >= _LAST)


@compiled
def _outlier_of(
    expected: Expected, frame: TrackedFrame, table: ReadingsTable, rules: Rules
) -> float:
    """Return the probability that a frame stated empty is an outlier of what is expected."""
    where = expected.mean1, expected.mean2, expected.spread
    usual = math.log1p(-rules.outlier) + expected.log_density
    odd = math.log(rules.outlier) + log_outlier(frame, where, table, rules)
    return 1.0 / (1.0 + math.exp(min(usual - odd, 700.0)))


@borrowed
@compiled
def _tell_rival(
    of: Hypotheses,
    table: ReadingsTable,
    empty: Array,
    first: Hypotheses,
    rules: Rules,
    scratch: Scratch,
) -> None:
    """Make row 1 the rival: what was known before any frame, taught by the rival's frames.

    Crosstalk that is stated to drift may have drifted to where they are.
    """
    numbers = of.numbers
    copy(of, 1, first, 0)
    if rules.drift1 > 0.0 or rules.drift2 > 0.0:
        away1 = abs(numbers[RIVAL1] - of.x[1, CROSSTALK1])
        away2 = abs(numbers[RIVAL2] - of.x[1, CROSSTALK2])
        move(of, 1, Motion(0.0, 0.0, Root(0.0, 0.0, 0.0), away1, away2), scratch.work)
    gain = numbers[RIVAL_GAIN]
    mean1 = numbers[RIVAL1] + gain * empty[FIRST, 0]
    mean2 = numbers[RIVAL2] + gain * empty[SECOND, 0]
    frame = TrackedFrame(mean1, mean2, gain, 0.0, 0.0)
    expected = expect_empty(of, 1, frame, table, empty, scratch.nuisance)
    part, noise = math.sqrt(numbers[RIVAL_VARIANCE]), expected.noise
    noise = Root(part * noise.r11, part * noise.r21, part * noise.r22)
    e1, e2 = mean1 - expected.mean1, mean2 - expected.mean2
    update(of, 1, Linear(e1, e2, 0.0, 0.0, 0.0, 0.0, noise), scratch, of.X.shape[1])


@compiled
def _start_rival(numbers: Array, frame: TrackedFrame, empty: Array) -> None:
    """Let a frame that agrees with nothing be the rival."""
    numbers[RIVAL], numbers[RIVAL_VARIANCE] = 1.0, 1.0
    numbers[RIVAL1] = frame.first - frame.gain * empty[FIRST, 0]
    numbers[RIVAL2] = frame.second - frame.gain * empty[SECOND, 0]
    numbers[RIVAL_GAIN], numbers[RIVAL_TIME] = frame.gain, numbers[TIME]


@compiled
def _teach_rival(numbers: Array, frame: TrackedFrame, empty: Array) -> None:
    """Take a frame into the rival's mean."""
    share = numbers[RIVAL_VARIANCE] / (numbers[RIVAL_VARIANCE] + 1.0)
    numbers[RIVAL1] += share * (frame.first - frame.gain * empty[FIRST, 0] - numbers[RIVAL1])
    numbers[RIVAL2] += share * (frame.second - frame.gain * empty[SECOND, 0] - numbers[RIVAL2])
    numbers[RIVAL_GAIN] += share * (frame.gain - numbers[RIVAL_GAIN])
    numbers[RIVAL_VARIANCE] = share
    numbers[RIVAL] += 1.0


@compiled
def _exchange(of: Hypotheses, gain: float) -> None:
    """Hold the rival, which row 1 is, and make what was held the rival."""
    numbers, x = of.numbers, of.x
    numbers[RIVAL1], numbers[RIVAL2] = x[0, CROSSTALK1], x[0, CROSSTALK2]
    numbers[RIVAL_VARIANCE], numbers[RIVAL_GAIN] = 1.0 / numbers[HELD], gain
    numbers[HELD], numbers[RIVAL] = numbers[RIVAL], numbers[HELD]
    numbers[RUN] = 0.0
    copy(of, 0, of, 1)
    tell_all(of)  # the rival knows of no object


@borrowed
@compiled
def learn_stated(
    of: Hypotheses,
    frame: TrackedFrame,
    table: ReadingsTable,
    empty: Array,
    first: Hypotheses,
    rules: Rules,
    scratch: Scratch,
) -> tuple[float, float]:
    """Learn the crosstalk, where it is learnt, from a frame that is stated to hold no object.

    Parameters
    ----------
    of : Hypotheses
        As predicted; changed in place.
    frame : TrackedFrame
        The frame.
    table : ReadingsTable
        Known crosstalk, and the noise.
    empty : ndarray, shape (2, 1 + p)
        As for `inference.tracking.empty_scene.expect_empty`.
    first : Hypotheses
        The state before any frame.
    rules : Rules
        How often frames are outliers, and how crosstalk drifts.
    scratch : Scratch
        Overwritten.

    Returns
    -------
    (float, float)
        Probability that the frame is an outlier, 0 where crosstalk is not learnt, and its surprise.
    """
    if not learns_crosstalk(of):
        return 0.0, learn_empty(of, frame, table, empty, scratch)
    numbers = of.numbers
    expected = expect_empty(of, 0, frame, table, empty, scratch.nuisance)
    outlier = _outlier_of(expected, frame, table, rules)
    odd = outlier >= _EVEN
    if numbers[HELD] == 0.0 and (odd or unknown_crosstalk(of, 0) < _TOLD):
        numbers[HELD] = 1.0
    if not odd:
        numbers[HELD], numbers[RUN] = numbers[HELD] + 1.0, 0.0
        residual = frame.first - expected.mean1, frame.second - expected.mean2
        take_stated(of, residual, expected.noise, scratch.nuisance)
        return outlier, learn_empty(of, frame, table, empty, scratch)
    numbers[RUN] += 1.0
    numbers[COUNT] = 0.0  # row 1 is free
    own = 1.0
    if numbers[RIVAL] > 0.0:
        drift = max(rules.drift1, rules.drift2)
        numbers[RIVAL_VARIANCE] += drift * drift * (numbers[TIME] - numbers[RIVAL_TIME])
        numbers[RIVAL_TIME] = numbers[TIME]
        _tell_rival(of, table, empty, first, rules, scratch)
        expected = expect_empty(of, 1, frame, table, empty, scratch.nuisance)
        own = _outlier_of(expected, frame, table, rules)
    if own < _EVEN:
        _teach_rival(numbers, frame, empty)
        if numbers[RIVAL] > numbers[HELD]:
            _tell_rival(of, table, empty, first, rules, scratch)
            _exchange(of, frame.gain)
            outlier = own
    elif numbers[RIVAL] > 1.0:
        # a third opinion: one vote less for either, so that a tie stays one
        numbers[RIVAL], numbers[HELD] = numbers[RIVAL] - 1.0, numbers[HELD] - 1.0
    else:
        _start_rival(numbers, frame, empty)
    return outlier, rules.most_surprise


@borrowed
@compiled
def open_crosstalk(
    of: Hypotheses,
    table: ReadingsTable,
    empty: Array,
    first: Hypotheses,
    rules: Rules,
    scratch: Scratch,
) -> None:
    """Make the crosstalk as wide as both that frames stated empty tell, before one that is not.

    In every direction: known to noise across the line between the two, one frame of an object
    would tell both where it is and where on that line the crosstalk, by the wrong root as well.

    Parameters
    ----------
    of : Hypotheses
        After a frame that is stated empty; changed in place.
    table, empty, first, rules, scratch
        As for `learn_stated`.
    """
    _tell_rival(of, table, empty, first, rules, scratch)
    away1 = of.x[1, CROSSTALK1] - of.x[0, CROSSTALK1]
    away2 = of.x[1, CROSSTALK2] - of.x[0, CROSSTALK2]
    half = 0.5 * math.hypot(away1, away2)
    merge(of, 0, 1, 0.5, CROSSTALK1, scratch.work)
    move(of, 0, Motion(0.0, 0.0, Root(0.0, 0.0, 0.0), half, half), scratch.work)
    of.numbers[HELD], of.numbers[RIVAL], of.numbers[RUN] = 0.0, 0.0, 0.0
    tell_all(of)


@borrowed
@compiled
def describe_contradicted(
    out: Array,
    i: int,
    of: Hypotheses,
    table: ReadingsTable,
    empty: Array,
    first: Hypotheses,
    rules: Rules,
    scratch: Scratch,
) -> None:
    """Report crosstalk as wide as both that frames stated empty tell.

    Parameters
    ----------
    out : ndarray, shape (frames, REPORT_COLUMNS)
        The report.
    i : int
        The frame.
    of, table, empty, first, rules, scratch
        As for `open_crosstalk`; row 1 is overwritten.
    """
    _tell_rival(of, table, empty, first, rules, scratch)
    for k in range(2):
        state = CROSSTALK1 + k
        half = 0.5 * (of.x[1, state] - of.x[0, state])
        square = half * half
        for row in range(2):
            for j in range(of.X.shape[-1]):
                square += 0.5 * of.X[row, state, j] * of.X[row, state, j]
        out[i, CROSSTALK + k] = of.x[0, state] + half
        out[i, CROSSTALK + 2 + k] = math.sqrt(square)
