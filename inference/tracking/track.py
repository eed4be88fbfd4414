"""Tracking: frames in, ranges with their hypotheses out, in one batch or frame by frame."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status
from inference.posterior.answer.posterior import Posterior
from inference.tracking.filter import EMPTY, EMPTY_SATURATED, SATURATED, run_filter
from inference.tracking.hypotheses import TIME, copied
from inference.tracking.known_range import beyond_support
from inference.tracking.misfit import misfits
from inference.tracking.reasons import REASONS, reason_codes
from inference.tracking.report import (
    BEST,
    CROSSTALK,
    HYPOTHESES,
    HYPOTHESIS_COLUMNS,
    MODEL_SD,
    OUTLIER,
    POSITION,
    PRESENT,
    RATE,
    RATE_SD,
    REPORT_COLUMNS,
    SCENE_SD,
    SD,
    STATUS,
    SURPRISE,
    WEIGHT,
)
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import TrackState, check_state
from inference.tracking.tracker import Tracker, tracker
from simulator.at_temperature import at_reference
from simulator.errors import InvalidInputError
from simulator.frames import Frames, check_frames, check_increasing
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Track", "step", "track"]

Array = NDArray[np.float64]

_FARTHEST = 1e100  # a reading this many standard deviations off is off by any measure


@dataclasses.dataclass(frozen=True, eq=False)
class Track:
    """What the tracker says of n frames.

    Attributes
    ----------
    status : ndarray of uint8, shape (n,)
        `Status`: one range, several, no object, or saturated (then everything is predicted).
    present : ndarray, shape (n,)
        Probability that an object is there.
    best_m, best_sd_m : ndarray, shape (n,)
        The heaviest range and its standard deviation [m]; nan where no object is there.
    sd_parts_m : SdParts
        Its parts, each of shape (n,): by noise and motion, by what the scene knows only to some
        extent, by errors of the model. The latter two are shared by all frames.
    rate_m_s, rate_sd_m_s : ndarray, shape (n,)
        dr/dt and its standard deviation [m/s].
    weight : ndarray, shape (n,)
        Probability of that range, given that an object is there.
    outlier : ndarray, shape (n,)
        Probability that the frame's readings have nothing to do with the scene.
    surprise : ndarray, shape (n,)
        Running mean of the normalised innovation squared per reading: 1 where all is as modelled.
    misfit, in_a_row : ndarray of bool, shape (n,)
        Whether it, jumps, what lasts beside the curve or outliers in a row are above what chance
        allows, readings do not change, or learnt crosstalk is far from its prior: scene, noise or
        motion are not as stated. Whether outliers in a row alone say so.
    hypotheses_m, hypotheses_sd_m, hypotheses_weight : ndarray, shape (n, k)
        All ranges by ascending order, padded with nan [m].
    crosstalk, crosstalk_sd : ndarray, shape (n, 2), optional
        What was learnt of the crosstalk [reading units]; None where it is not learnt.
    """

    status: NDArray[np.uint8]
    present: Array
    best_m: Array
    best_sd_m: Array
    sd_parts_m: SdParts
    rate_m_s: Array
    rate_sd_m_s: Array
    weight: Array
    outlier: Array
    surprise: Array
    misfit: NDArray[np.bool_]
    in_a_row: NDArray[np.bool_]
    hypotheses_m: Array
    hypotheses_sd_m: Array
    hypotheses_weight: Array
    crosstalk: Array | None
    crosstalk_sd: Array | None

    def __len__(self) -> int:
        return int(self.status.size)

    @property
    def range_m(self) -> Array:
        """The range where it is unique, else nan; shape (n,) [m]."""
        return np.where(self.status == Status.UNIQUE, self.best_m, np.nan)

    @property
    def sd_m(self) -> Array:
        """Standard deviation of the unique range, else nan; shape (n,) [m]."""
        return np.where(self.status == Status.UNIQUE, self.best_sd_m, np.nan)

    @property
    def reasons(self) -> list[str]:
        """Why a frame has the status none, in words; empty where it has another; n of them."""
        count = np.isfinite(self.hypotheses_m).sum(axis=1, dtype=np.uint8)
        codes = reason_codes(self.status, self.present, self.outlier, count)
        return [REASONS[code] for code in codes.tolist()]


def step(
    model: Tracker, state: TrackState, frames: Frames, full: bool = False
) -> tuple[TrackState, Track]:
    """Take in one frame or many.

    Pure: the same state and frames give the same result, and however a stream is cut, its results
    are the same to the last bit.

    Parameters
    ----------
    model : Tracker
        From `tracker`.
    state : TrackState
        `Tracker.first`, or what the last step returned.
    frames : Frames
        With times that increase and are later than the state's. ``object_present`` false says that
        no object is there; true says nothing. Where crosstalk is learnt, such a frame is an outlier
        where it contradicts the others. A known range is one more reading of its frame, and
        says that an object is there; readings that contradict it are an outlier. Where the sensor
        follows its temperature, and that is not known, the readings say nothing: the status is
        none, and everything is predicted.
    full : bool
        Whether to look for new objects along the whole range in every frame, also where none could
        be heavy enough to be kept: slower, with the same answer to within what is negligible.

    Returns
    -------
    (TrackState, Track)

    Raises
    ------
    InvalidInputError
        At "/frames/..." for a column of another length, or not finite, and for a gain that is not
        positive; at "/frames/time_s" where times are missing, repeated or go back; at
        "/frames/dw1_dt" and its like where derivatives are tracked and missing; at
        "/frames/known_range_m" for ranges that the scene does not allow; at
        "/frames/displacement_m" for any; at "/state" for another tracker's state.
    """
    if state.signature != model.first.signature:
        raise InvalidInputError.at("/state", "belongs to another tracker")
    check_state(state, model.first)
    check_frames(model.sensor, frames)
    times = _times(frames, float(state.hypotheses.numbers[TIME]))
    kinds = np.zeros(len(frames), dtype=np.uint8)
    beyond = frames.saturated(model.sensor)
    kinds[beyond] = SATURATED
    untold = None
    if model.sensor.temperature is not None and frames.temperature_k is not None:
        untold = np.isnan(frames.temperature_k)
        kinds[untold] = SATURATED  # as unreadable as those
        frames = at_reference(model.sensor, frames, model.crosstalk)[1]
    if frames.object_present is not None:
        kinds[~frames.object_present] = EMPTY
        # crosstalk cannot be learnt from a reading that is cut
        kinds[~frames.object_present & beyond] = EMPTY_SATURATED
        if untold is not None:
            kinds[~frames.object_present & untold] = EMPTY_SATURATED
    values = _observations(model, frames)
    gain = frames.gains
    out = np.full((len(frames), REPORT_COLUMNS), np.nan)
    rows = np.full((len(frames), model.settings.hypotheses, HYPOTHESIS_COLUMNS), np.nan)
    hypotheses = copied(state.hypotheses)
    columns = [values, gain, *_known(model, frames)]
    table = np.ascontiguousarray(np.column_stack(columns))
    run_filter(out, rows, times, table, kinds, hypotheses, model.model, full)
    if untold is not None:
        out[untold, STATUS] = Status.NONE
    return TrackState(hypotheses, state.signature), _track(model, out, rows)


def track(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    settings: TrackingSettings | None = None,
    posterior: Posterior | Array | None = None,
) -> Track:
    """Track an object through all frames of a recording.

    Parameters
    ----------
    sensor, scene, settings, posterior
        As for `tracker`.
    frames : Frames
        With times that increase.

    Returns
    -------
    Track

    Raises
    ------
    InvalidInputError, RefusedError
        As `tracker` and `step`.
    """
    model = tracker(sensor, scene, settings, posterior)
    return step(model, model.first, frames)[1]


def _times(frames: Frames, last: float) -> Array:
    if frames.time_s is None:
        raise InvalidInputError.at("/frames/time_s", "is missing: a tracker needs it")
    times = np.ascontiguousarray(frames.time_s, dtype=np.float64)
    check_increasing(times)
    if not np.isnan(last) and not times[0] > last:
        raise InvalidInputError.at(
            "/frames/time_s", f"entry 0 is not later than the last frame, {last:.15g} s"
        )
    return times


def _known(model: Tracker, frames: Frames) -> list[Array]:
    """Return known ranges and one over their standard deviations, checked; nothing without any."""
    if frames.displacement_m is not None:
        first = np.flatnonzero(np.isfinite(frames.displacement_m))[0]
        raise InvalidInputError.at(
            "/frames/displacement_m",
            f"entry {first} is given, and a tracker takes no displacements: their offset is an "
            "unknown of many frames, which a posterior finds; give known_range_m, or null",
        )
    known, sd = frames.known_range_m, frames.known_range_sd_m
    if known is None or sd is None:
        return []
    if (beyond := beyond_support(known, sd, model.model.table)).size:
        low, high = np.exp([model.model.table.start, model.model.table.end])
        raise InvalidInputError.at(
            "/frames/known_range_m",
            f"entry {beyond[0]} is {known[beyond[0]]:g} m, and the scene and the sensor allow "
            f"ranges from {low:.4g} to {high:.4g} m: state a wider range_m",
        )
    return [np.where(told := np.isfinite(known), known, 0.0), np.where(told, 1.0 / sd, 0.0)]


def _observations(model: Tracker, frames: Frames) -> Array:
    """Return what is tracked, in units of its noise, shape (n, 2)."""
    values = frames.readings
    if model.observed.by_rate:
        if frames.derivatives is None:
            first, second = (f"d{name}_dt" for name in model.sensor.columns)
            raise InvalidInputError.at(f"/frames/{first}", f"is missing, with {second}")
        values = frames.derivatives
    with np.errstate(over="ignore"):
        scaled = np.where(model.observed.used, values / np.asarray(model.observed.units), 0.0)
    return np.clip(scaled, -_FARTHEST, _FARTHEST)


def _track(model: Tracker, out: Array, rows: Array) -> Track:
    """Turn the kernel's report into metres and seconds."""
    width = max(int(out[:, HYPOTHESES].max(initial=0.0)), 1)
    rows = rows[:, :width]
    crosstalk = crosstalk_sd = None
    if model.learns_crosstalk:
        crosstalk = out[:, CROSSTALK : CROSSTALK + 2] * model.observed.units
        crosstalk_sd = out[:, CROSSTALK + 2 : CROSSTALK + 4] * model.observed.units
    range_m, ranges = np.exp(out[:, BEST + POSITION]), np.exp(rows[:, :, POSITION])
    sd, scene, error = (out[:, BEST + column] for column in (SD, SCENE_SD, MODEL_SD))
    added = model.added(out[:, BEST + POSITION])
    lasting, in_a_row = misfits(out, model.limits, crosstalk, model.crosstalk_bounds)
    return Track(
        status=out[:, STATUS].astype(np.uint8),
        present=out[:, PRESENT].copy(),
        best_m=range_m,
        best_sd_m=range_m * np.hypot(sd, added),
        sd_parts_m=SdParts(
            range_m * np.sqrt(np.maximum(sd**2 - scene**2 - error**2, 0.0)),
            range_m * scene,
            range_m * np.hypot(error, added),
        ),
        rate_m_s=range_m * out[:, BEST + RATE],
        rate_sd_m_s=range_m * out[:, BEST + RATE_SD],
        weight=out[:, BEST + WEIGHT].copy(),
        outlier=out[:, OUTLIER].copy(),
        surprise=out[:, SURPRISE].copy(),
        misfit=lasting | in_a_row,
        in_a_row=in_a_row & ~lasting,
        hypotheses_m=ranges,
        hypotheses_sd_m=ranges * np.hypot(rows[:, :, SD], model.added(rows[:, :, POSITION])),
        hypotheses_weight=rows[:, :, WEIGHT].copy(),
        crosstalk=crosstalk,
        crosstalk_sd=crosstalk_sd,
    )
