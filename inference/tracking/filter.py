"""The filter: frames in, weighted hypotheses out, one frame after the other.

A pure fold in machine code. It knows of the past what its arrays hold, so that the result does not
depend on how a stream is cut into batches.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.by_frame import as_said
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    COUNT,
    PENDING,
    ROUGHNESS,
    RUNNING,
    TIME,
    Hypotheses,
    copy,
    learns_crosstalk,
    stuck_for,
    take_readings,
)
from inference.tracking.lasting import lasting_of
from inference.tracking.prediction import predict
from inference.tracking.readings_table import nuisance_count
from inference.tracking.report import (
    BEST,
    LASTING,
    OUTLIER,
    OUTLIERS_RUN,
    POSITION,
    PRESENT,
    SD,
    STATUS,
    STUCK,
    SURPRISE,
    UNSTEADY_MEAN,
    report,
)
from inference.tracking.resting import least_present, nothing_has_changed
from inference.tracking.stated_empty import (
    describe_contradicted,
    is_contradicted,
    learn_stated,
    open_crosstalk,
)
from inference.tracking.stillness import begin_anew, is_still, mean_at_rest, take_still
from inference.tracking.unsteady import OUTLIERS, UNSTEADY, take_empty, take_unsteady
from inference.tracking.weighing import Model, room_for, weigh_frame, weigh_known
from simulator.closed import closed
from simulator.compiled import compiled

__all__ = ["EMPTY", "EMPTY_SATURATED", "SATURATED", "USABLE", "run_filter"]

Array = NDArray[np.float64]

# what is known of a frame before it is looked at
USABLE, SATURATED, EMPTY, EMPTY_SATURATED = range(4)
# columns of frames, the last two only where ranges are known
_FIRST, _SECOND, _GAIN, _KNOWN_M, _KNOWN_RATE = range(5)
_SATURATED = int(Status.SATURATED)
_LATE = 4.0  # frames over which the roughness of the motion is a mean


@closed
@compiled
def run_filter(
    out: Array,
    rows: Array,
    times: Array,
    frames: Array,
    kinds: NDArray[np.uint8],
    of: Hypotheses,
    model: Model,
    full: bool,
) -> None:
    """Run the filter over frames.

    Parameters
    ----------
    out, rows : ndarray
        Filled, as `report` has it.
    times : ndarray, shape (frames,)
        Times [s], increasing, later than the state's.
    frames : ndarray, shape (frames, 3 or 5)
        Readings in units of the read noise, the gain factor, and the range that is known beside
        them [m] with one over its standard deviation [1/m], 0 where none is.
    kinds : ndarray of uint8, shape (frames,)
        `USABLE`, `SATURATED`, `EMPTY` (known to hold no object) or `EMPTY_SATURATED`.
    of : Hypotheses
        State, changed in place.
    model : Model
        Scene, sensor and rules.
    full : bool
        Whether to look for new objects along the whole curve in every frame, also where none could
        weigh enough to be kept.
    """
    room = room_for(of, model.places)
    rules, numbers = model.rules, of.numbers
    for i in range(times.size):
        seconds = 0.0
        stated = kinds[i] == EMPTY or kinds[i] == EMPTY_SATURATED
        if not stated and is_contradicted(of):
            open_crosstalk(of, model.table, model.places.empty, model.first, rules, room.scratch)
        if learns_crosstalk(of) and kinds[i] == USABLE:
            rest, untold = mean_at_rest(of), is_still(of) and nothing_has_changed(of)
            now = TrackedFrame(frames[i, _FIRST], frames[i, _SECOND], frames[i, _GAIN], 0.0, 0.0)
            take_still(of, now, times[i], rules, model.table)
            if untold and not is_still(of) and begin_anew(of, model.first, room.empty):
                weigh_frame(rest, 0.0, of, model, room, full)
                copy(of, 0, room.empty, 0)
        if math.isfinite(numbers[TIME]):
            seconds = times[i] - numbers[TIME]
            predict(seconds, of, rules, model.table, room.scratch.work)
        numbers[TIME] = times[i]
        known_m, known_rate = 0.0, 0.0
        if frames.shape[1] > _KNOWN_M:
            known_m, known_rate = frames[i, _KNOWN_M], frames[i, _KNOWN_RATE]
        frame = TrackedFrame(
            frames[i, _FIRST], frames[i, _SECOND], frames[i, _GAIN], known_m, known_rate
        )
        take_readings(numbers, frames[i, _FIRST], frames[i, _SECOND])
        outlier, surprise = 0.0, math.nan
        if kinds[i] == USABLE:
            outlier, surprise = weigh_frame(frame, seconds, of, model, room, full)
        elif kinds[i] == SATURATED:
            if known_rate > 0.0:
                weigh_known(frame, of, model, room)
        else:
            if kinds[i] == EMPTY:
                outlier, surprise = learn_stated(
                    of, frame, model.table, model.places.empty, model.first, rules, room.scratch
                )
            of.weight[0], numbers[PENDING], numbers[COUNT] = 1.0, 0.0, 0.0
        if not math.isnan(surprise):
            own = min(surprise, rules.most_surprise) / model.table.channels
            numbers[RUNNING] += (1.0 - rules.memory) * (own - numbers[RUNNING])
            numbers[ROUGHNESS] += (min(own, 1.0) - numbers[ROUGHNESS]) / _LATE
        told = of
        if learns_crosstalk(of) and nuisance_count(model.table) > 0:
            readable = kinds[i] == USABLE and outlier < 0.5 and not known_rate > 0.0
            told, factors = room.after, room.scratch.factors
            as_said(told, of, frame, readable, model.table, factors)
        report(out, rows, i, told, rules, model.table, room.described)
        if is_contradicted(of):
            describe_contradicted(
                out, i, of, model.table, model.places.empty, model.first, rules, room.scratch
            )
        usual = 1.0 - outlier if kinds[i] == USABLE else 0.0
        least = least_present(of, frame, model.table, usual, stated)
        out[i, PRESENT] = max(out[i, PRESENT], least)
        out[i, OUTLIER], out[i, SURPRISE] = outlier, numbers[RUNNING]
        out[i, STUCK] = stuck_for(numbers)
        if numbers.size > UNSTEADY:
            if outlier >= 0.5:
                numbers[OUTLIERS] += 1.0
            elif kinds[i] == USABLE or kinds[i] == EMPTY:
                numbers[OUTLIERS] = 0.0
                if out[i, PRESENT] > 0.5:
                    u, sd = out[i, BEST + POSITION], out[i, BEST + SD]
                    take_unsteady(of, 1, u, sd, frame, times[i], model.table, rules)
                else:
                    take_empty(of, frame, times[i], model.table, model.places.empty, rules)
            out[i, OUTLIERS_RUN] = numbers[OUTLIERS]
            out[i, UNSTEADY_MEAN] = numbers[UNSTEADY]
            out[i, LASTING] = lasting_of(numbers, nuisance_count(model.table), rules.memory)
        if kinds[i] == SATURATED or kinds[i] == EMPTY_SATURATED:
            out[i, STATUS] = _SATURATED
