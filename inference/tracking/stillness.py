"""Readings that stay as they are, where crosstalk is learnt: what frames at rest do not tell.

Range and crosstalk are told apart by how an object moves. Frames of an object at rest are all one
frame, and what they seem to tell beyond it is the bend of the curve, seen through the noise from
another place each time: a little in every frame, and always to the same side. So crosstalk learns
nothing of readings that stay as they are (it is considered, as nuisance parameters are), and what a
hypothesis of the first rest has come to is forgotten as soon as something changes: all ranges are
then as possible as they were, with the mean of these frames as the first.

Crosstalk that drifts by more than the noise of that mean is another in every frame. It is learnt
also at rest: held where the empty scene's goes on learning, an object that was slow for two seconds
was taken for an empty scene, and came back at a wrong range.

docs/model.md, stillness, has the rule.
"""

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    BRIGHT,
    COUNT,
    LATE1,
    LATE2,
    LOST,
    PENDING,
    ROUGHNESS,
    SINCE,
    STAY1,
    STAY2,
    STAYED,
    STILL,
    Array,
    Hypotheses,
    U,
    copy,
    heaviest,
    unknown_crosstalk,
)
from inference.tracking.motion import Rules
from inference.tracking.readings_table import ReadingsTable, noise_root, object_at
from inference.tracking.resting import nothing_has_changed
from inference.tracking.roots import UNIT, Root, solve
from simulator.compiled import compiled

__all__ = ["begin_anew", "crosstalk_is_held", "is_still", "mean_at_rest", "take_still"]

# squared distances from the mean, in units of their noise, that noise exceeds once in 3,000 frames,
# and that of the mean of late
_ONE_AWAY = 16.0
_LATE_AWAY = 12.0
_LATE = 25.0  # frames of the mean of late
# from so many frames on that have stayed, and so much of the time over which a rate is remembered,
# readings are still
_FRAMES, _SECONDS = 10.0, 0.25
# and at rest: where an object turns round readings are still for a moment, too
_REST_FRAMES, _REST_SECONDS = 20.0, 0.5
# variance of the crosstalk by its drift, in that of the frames' mean, from which on they are no
# longer one frame: what is learnt of crosstalk is then forgotten before it adds up
_DRIFTED = 1.0
# values of `STILL`
_NO, _STILL, _REST = 0.0, 1.0, 2.0
_MOST = 300.0  # frames of the mean: beyond them it follows what drifts
# variance of a reading by crosstalk, in that of the noise, from which on nothing has told it
_UNTOLD = 10.0


@compiled
def is_still(of: Hypotheses) -> bool:
    """Tell whether the readings stay as they are."""
    return bool(of.numbers[STILL] > _NO)


@compiled
def crosstalk_is_held(of: Hypotheses) -> bool:
    """Tell whether crosstalk learns nothing of a frame: at a rest that is not the first."""
    return bool(of.numbers[STILL] == _REST) and not nothing_has_changed(of)


@compiled
def mean_at_rest(of: Hypotheses) -> TrackedFrame:
    """Return the mean of the readings that have stayed, as one frame."""
    numbers = of.numbers
    return TrackedFrame(numbers[STAY1], numbers[STAY2], numbers[BRIGHT], 0.0, 0.0)


@compiled
def _noise_of(of: Hypotheses, frame: TrackedFrame, table: ReadingsTable) -> Root:
    """Return the root of the noise's covariance at the readings themselves."""
    if table.noise.plain:
        return UNIT
    o1, o2, row = 0.0, 0.0, heaviest(of)
    if row > 0:
        o1, o2 = object_at(of.x[row, U], table)
    return noise_root(frame.first, frame.second, frame.gain * o1, frame.gain * o2, table.noise)


@compiled
def _square(noise: Root, first: float, second: float) -> float:
    """Return the square of a difference of readings, in units of the noise."""
    y1, y2 = solve(noise, first, second)
    return first * y1 + second * y2


@compiled
def _start(numbers: Array, frame: TrackedFrame, time: float) -> None:
    """Let a rest begin with a frame."""
    numbers[STILL], numbers[SINCE], numbers[STAYED] = _NO, time, 1.0
    numbers[STAY1], numbers[STAY2] = frame.first, frame.second
    numbers[LATE1], numbers[LATE2] = frame.first, frame.second
    numbers[BRIGHT] = frame.gain


@borrowed
@compiled
def take_still(
    of: Hypotheses, frame: TrackedFrame, time: float, rules: Rules, table: ReadingsTable
) -> None:
    """Take a frame into what tells whether the readings stay as they are.

    Parameters
    ----------
    of : Hypotheses
        The state; its numbers are changed in place.
    frame, time : TrackedFrame, float
        The frame and when it was [s].
    rules, table : Rules, ReadingsTable
        Drift of the crosstalk, memory of the rate, and the noise.
    """
    numbers = of.numbers
    n = numbers[STAYED]
    if n == 0.0 or frame.gain != numbers[BRIGHT]:
        _start(numbers, frame, time)
        return
    share = 1.0 / min(n + 1.0, _LATE)
    numbers[LATE1] += share * (frame.first - numbers[LATE1])
    numbers[LATE2] += share * (frame.second - numbers[LATE2])
    noise = _noise_of(of, frame, table)
    first, second = frame.first - numbers[STAY1], frame.second - numbers[STAY2]
    away = _square(noise, first, second)
    away_of_late = _square(noise, numbers[LATE1] - numbers[STAY1], numbers[LATE2] - numbers[STAY2])
    seconds, drift = time - numbers[SINCE], max(rules.drift1, rules.drift2)
    drifted = drift * drift * seconds
    # of an exponential mean, and of a plain one while that has fewer frames
    of_late = max(1.0 / (n + 1.0), 1.0 / (2.0 * _LATE - 1.0))
    moved = away > _ONE_AWAY * (1.0 + 1.0 / n + drifted)
    if moved or away_of_late > _LATE_AWAY * (of_late + drifted):
        _start(numbers, frame, time)
        return
    n = min(n + 1.0, _MOST)
    numbers[STAYED] = n
    numbers[STAY1] += first / n
    numbers[STAY2] += second / n
    one_frame = drifted * n < _DRIFTED
    if one_frame and n >= _REST_FRAMES and seconds >= _REST_SECONDS * rules.rate_time:
        numbers[STILL] = _REST
    elif n >= _FRAMES and seconds >= _SECONDS * rules.rate_time:
        numbers[STILL] = _STILL


@borrowed
@compiled
def begin_anew(of: Hypotheses, first: Hypotheses, empty: Hypotheses) -> bool:
    """Forget the hypotheses of a first rest, unless something has told them the crosstalk.

    Parameters
    ----------
    of : Hypotheses
        Changed in place: as before any frame, but for what is counted over frames.
    first : Hypotheses
        The state before any frame.
    empty : Hypotheses
        Its row 0 is overwritten by what is known of the empty scene, whose crosstalk these frames
        do tell.

    Returns
    -------
    bool
        Whether they were forgotten.
    """
    row = heaviest(of)
    if row > 0 and unknown_crosstalk(of, row) < _UNTOLD:
        return False
    copy(empty, 0, of, 0)
    for j in range(of.weight.size):
        copy(of, j, first, j)
        of.weight[j] = first.weight[j]
    for k in (PENDING, COUNT, LOST, ROUGHNESS):
        of.numbers[k] = first.numbers[k]
    return True
