"""Whether the light of a scene whose crosstalk is learnt may be that of an object at rest.

Hypotheses of an object at rest move on to where the curve is flat, since the motion that is stated
has to go somewhere, and what they weigh there says nothing of the object. So as long as nothing has
told crosstalk and object apart, the probability of an object that is answered has a least value.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    LEVEL1,
    LEVEL2,
    RESTING,
    Hypotheses,
    unknown_crosstalk,
)
from inference.tracking.readings_table import ReadingsTable
from simulator.compiled import compiled

__all__ = ["least_present", "nothing_has_changed"]

_LEAST = 0.2  # probability of an object that may rest
_CHANGED = 1e-3  # weight of the empty scene below which something has moved, or come
_BACK = 0.5  # weight of the empty scene from which on what came has gone
# of the noise: as near to what the crosstalk was before is as it was
_NEAR = 2.0
# of the noise: a change that is large enough to tell the crosstalk by its curve
_TELLING = 100.0
# values of `RESTING`
_NO, _STILL, _MOVED = 0.0, 1.0, 2.0


@compiled
def nothing_has_changed(of: Hypotheses) -> bool:
    """Tell whether readings are still those of the first frame, of crosstalk or an object."""
    return bool(of.numbers[RESTING] == _STILL)


@borrowed
@compiled
def least_present(
    of: Hypotheses, frame: TrackedFrame, table: ReadingsTable, usual: float, told_empty: bool
) -> float:
    """Return the least probability that an object is there, and note what a frame has told.

    Crosstalk is told by a frame without the object, by what came and went and left it as it was,
    and by a large change.

    Parameters
    ----------
    of : Hypotheses
        After the frame; its numbers are changed in place.
    frame : TrackedFrame
        The frame.
    table : ReadingsTable
        Known crosstalk.
    usual : float
        Probability that its readings are no outlier; 0 of a frame without readings.
    told_empty : bool
        Whether the frame was said to hold no object.
    """
    numbers, empty = of.numbers, of.weight[0]
    if numbers[RESTING] == _NO:
        return 0.0
    if told_empty:
        numbers[RESTING] = _NO
        return 0.0
    first, second = of.x[0, CROSSTALK1], of.x[0, CROSSTALK2]
    if numbers[RESTING] == _STILL and empty >= _CHANGED:
        numbers[LEVEL1], numbers[LEVEL2] = first, second
        return _LEAST
    numbers[RESTING] = _MOVED
    change1 = frame.first - table.crosstalk1 - numbers[LEVEL1]
    change2 = frame.second - table.crosstalk2 - numbers[LEVEL2]
    large = usual > 0.5 and math.hypot(change1, change2) > _TELLING
    away = math.hypot(first - numbers[LEVEL1], second - numbers[LEVEL2])
    known = unknown_crosstalk(of, 0) < 1.0
    if large or (empty > _BACK and known and away < _NEAR):
        numbers[RESTING] = _NO
        return 0.0
    return _LEAST
