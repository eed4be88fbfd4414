"""Frames: two readings each, with what else a sensor may deliver."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import pydantic
from numpy.typing import ArrayLike, NDArray

from simulator.errors import InvalidInputError, Problem
from simulator.known_ranges import MAY_BE_NULL, known_range_problems, telling
from simulator.other_readings import instead_of
from simulator.sensor import Sensor
from simulator.temperature import temperature_problems
from simulator.validated import Validated

__all__ = ["FrameColumns", "Frames", "check_frames", "check_increasing", "frames_from_columns"]

Array = NDArray[np.float64]
# a bad column is answered by its first bad entry, not by one problem for each of a million
_BOUNDS = pydantic.Field(max_length=2_000_000, fail_fast=True)
Column = Annotated[list[float], _BOUNDS]
NullableColumn = Annotated[list[float | None], _BOUNDS]


class FrameColumns(Validated):
    """Frames as columns, the form in which clients send them (docs/scenes.md, frames)."""

    time_s: Column | None = None
    w1: Column | None = None
    w2: Column | None = None
    i: Column | None = None
    q: Column | None = None
    dw1_dt: Column | None = None
    dw2_dt: Column | None = None
    di_dt: Column | None = None
    dq_dt: Column | None = None
    gain: Annotated[list[Annotated[float, pydantic.Field(gt=0)]], _BOUNDS] | None = None
    object_present: Annotated[list[bool], _BOUNDS] | None = None
    known_range_m: NullableColumn | None = None
    known_range_sd_m: NullableColumn | None = None
    displacement_m: NullableColumn | None = None
    displacement_sd_m: NullableColumn | None = None
    temperature_k: NullableColumn | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Frames:
    """Frames of one sensor, checked: equal lengths, at least one frame, everything finite.

    Attributes
    ----------
    readings : ndarray, shape (n, 2)
        w1, w2 or i, q [reading units].
    time_s : ndarray, shape (n,), optional
        Times [s], in any order.
    derivatives : ndarray, shape (n, 2), optional
        Time derivatives of the readings [reading units / s], measured by the sensor.
    gain : ndarray, shape (n,), optional
        Factor of each frame on the sensor's gain: it scales the signals of object and background,
        not crosstalk, which is given in reading units.
    object_present : ndarray of bool, shape (n,), optional
        False where the scene is known to hold no object.
    known_range_m, known_range_sd_m : ndarray, shape (n,), optional
        Ranges that a ruler or a robot tells, and their standard deviations [m]; nan where nothing
        is known. Posteriors and trackers use them.
    displacement_m, displacement_sd_m : ndarray, shape (n,), optional
        The same of ranges less one offset of all frames, as odometry tells them.
    temperature_k : ndarray, shape (n,), optional
        Temperature of the sensor [K]; nan where it is not known. Of a sensor without temperature
        coefficients it is not used.
    """

    readings: Array
    time_s: Array | None = None
    derivatives: Array | None = None
    gain: Array | None = None
    object_present: NDArray[np.bool_] | None = None
    known_range_m: Array | None = None
    known_range_sd_m: Array | None = None
    displacement_m: Array | None = None
    displacement_sd_m: Array | None = None
    temperature_k: Array | None = None

    def __len__(self) -> int:
        return int(self.readings.shape[0])

    @property
    def present(self) -> NDArray[np.bool_]:
        """Where an object may be, shape (n,)."""
        if self.object_present is None:
            return np.ones(len(self), dtype=bool)
        return self.object_present

    @property
    def gains(self) -> Array:
        """Factor of each frame on the sensor's gain, shape (n,)."""
        return np.ones(len(self)) if self.gain is None else self.gain

    def saturated(self, sensor: Sensor) -> NDArray[np.bool_]:
        """Tell where a reading is at or beyond the sensor's full scale, shape (n,)."""
        if sensor.full_scale is None:
            return np.zeros(len(self), dtype=bool)
        return np.asarray((np.abs(self.readings) >= np.asarray(sensor.full_scale)).any(axis=1))

    def select(self, index: Any) -> "Frames":
        """Return the frames that a numpy index of the first axis selects."""
        parts: dict[str, Any] = {
            field.name: None if (part := getattr(self, field.name)) is None else part[index]
            for field in dataclasses.fields(self)
        }
        return Frames(**parts)

    def to_columns(self, sensor: Sensor) -> dict[str, list[Any]]:
        """Return the columns by name (docs/scenes.md, frames), those that are present."""
        first, second = sensor.columns
        columns: dict[str, Any] = {} if self.time_s is None else {"time_s": self.time_s}
        columns |= {first: self.readings[:, 0], second: self.readings[:, 1]}
        if self.derivatives is not None:
            columns[f"d{first}_dt"] = self.derivatives[:, 0]
            columns[f"d{second}_dt"] = self.derivatives[:, 1]
        if self.gain is not None:
            columns["gain"] = self.gain
        if self.object_present is not None:
            columns["object_present"] = self.object_present
        lists = {name: column.tolist() for name, column in columns.items()}
        for name in MAY_BE_NULL:
            if (column := getattr(self, name)) is not None:
                lists[name] = [None if np.isnan(value) else value for value in column.tolist()]
        return lists


def frames_from_columns(
    sensor: Sensor, columns: "FrameColumns | Mapping[str, ArrayLike | None]"
) -> Frames:
    """Check columns against a sensor and against one another.

    Parameters
    ----------
    sensor : Sensor
        Decides which columns are readings.
    columns : FrameColumns or mapping
        Columns by their name (docs/scenes.md, frames), each of length n.

    Returns
    -------
    Frames
        The frames.

    Raises
    ------
    InvalidInputError
        A pointer for each column that is missing, unknown, of another length, not numeric, not
        finite, empty, or (gain) not positive, or that tells ranges which cannot be.
    """
    if isinstance(columns, FrameColumns):
        columns = columns.__dict__  # in the order of the fields
    given = {name: column for name, column in columns.items() if column is not None}
    first, second = sensor.columns
    slopes, allowed = _columns_of(first, second)
    problems = [
        Problem(f"/{name}", f"is not a column of a {sensor.kind} sensor{_of_another(name)}")
        for name in given
        if name not in allowed
    ]
    needed = [first, second] + (list(slopes) if any(name in given for name in slopes) else [])
    problems += [Problem(f"/{name}", "is missing") for name in needed if name not in given]

    arrays: dict[str, NDArray[Any]] = {}
    for name in given:
        if name not in allowed:
            continue
        array, problem = _as_column(name, given[name])
        arrays[name] = array
        if problem:
            problems.append(Problem(f"/{name}", problem))
    if not problems:
        n = arrays[first].size
        if n == 0:
            problems.append(Problem(f"/{first}", "holds no frame"))
        problems += [
            Problem(f"/{name}", f"has {array.size} entries where {first} has {n}")
            for name, array in arrays.items()
            if array.size != n
        ]
        if "gain" in arrays and np.any(arrays["gain"] <= 0):
            problems.append(Problem("/gain", "must be positive"))
    if not problems:
        problems = known_range_problems(arrays, sensor.max_range_m)
        problems += temperature_problems(sensor.temperature, arrays.get("temperature_k"))
    if problems:
        raise InvalidInputError(*problems)
    readings = np.empty((n, 2))
    readings[:, 0], readings[:, 1] = arrays[first], arrays[second]
    return Frames(
        readings=readings,
        time_s=arrays.get("time_s"),
        derivatives=(
            np.column_stack([arrays[name] for name in slopes]) if slopes[0] in arrays else None
        ),
        gain=arrays.get("gain"),
        object_present=arrays.get("object_present"),
        **telling(arrays),
        temperature_k=arrays.get("temperature_k"),
    )


def _of_another(name: str) -> str:
    """Return of which sensor a column is that this one has not, or what to give instead."""
    for kind, columns in (("pulsed", ("w1", "w2")), ("sine_wave", ("i", "q"))):
        if name in columns or name in _columns_of(*columns)[0]:
            return f": it looks like one of a {kind} sensor; is the sensor's `kind` right?"
    remedy = instead_of(name)
    return f": {remedy}" if remedy else ""


@functools.cache
def _columns_of(first: str, second: str) -> tuple[tuple[str, str], frozenset[str]]:
    """Return the names of the derivatives of two readings, and all names of columns."""
    slopes = (f"d{first}_dt", f"d{second}_dt")
    more = ("time_s", "gain", "object_present", *MAY_BE_NULL)
    return slopes, frozenset({first, second, *slopes, *more})


def check_increasing(time_s: Array) -> None:
    """Refuse times that do not increase.

    Raises
    ------
    InvalidInputError
        At ``/frames/time_s``.
    """
    backward = np.flatnonzero(~(time_s[1:] > time_s[:-1]))
    if backward.size:
        message = f"must increase: entry {backward[0] + 1} does not"
        raise InvalidInputError.at("/frames/time_s", message)


def check_frames(sensor: Sensor, frames: Frames) -> None:
    """Check frames that did not come through `frames_from_columns`.

    Parameters
    ----------
    frames : Frames
        As a caller made them.

    Raises
    ------
    InvalidInputError
        A pointer below /frames for each column that is empty, of another length, not finite, or
        (gain, temperature_k) not positive.
    """
    first, second = sensor.columns
    readings = np.asarray(frames.readings)
    if readings.ndim != 2 or readings.shape[1] != 2:
        raise InvalidInputError.at("/frames", "readings must be of shape (n, 2)")
    columns = {
        first: readings[:, 0],
        second: readings[:, 1],
        "time_s": frames.time_s,
        "gain": frames.gain,
        "object_present": frames.object_present,
        **{name: getattr(frames, name) for name in MAY_BE_NULL},
    }
    if frames.derivatives is not None:
        slopes = np.asarray(frames.derivatives)
        if slopes.ndim != 2 or slopes.shape[1] != 2:
            raise InvalidInputError.at("/frames", "derivatives must be of shape (n, 2)")
        columns |= {f"d{first}_dt": slopes[:, 0], f"d{second}_dt": slopes[:, 1]}
    try:
        frames_from_columns(sensor, columns)
    except InvalidInputError as error:
        raise error.below("/frames") from None


def _as_column(name: str, values: ArrayLike) -> tuple[NDArray[Any], str | None]:
    """Return the column as an array, and what is wrong with it."""
    wanted = bool if name == "object_present" else float
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        return np.empty(0), "must be one-dimensional"
    if array.size == 0:
        return np.empty(0, dtype=wanted), None
    if array.ndim != 1:
        return np.empty(0), f"must be one-dimensional, has {array.ndim} dimensions"
    nullable = name in MAY_BE_NULL
    if nullable and array.dtype == object:
        array = np.array([np.nan if value is None else value for value in array.tolist()])
    if wanted is bool:
        if array.dtype != np.bool_:
            return array, "must be true or false for each frame"
        return array, None
    if array.dtype.kind not in "fiu":
        return array, "must hold numbers"
    array = array.astype(np.float64, copy=False)
    good = ~np.isinf(array) if nullable else np.isfinite(array)
    return array, None if good.all() else f"entry {good.argmin()} is not finite"
