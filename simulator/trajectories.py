"""Trajectories: the true range of every frame, and when it was taken."""

import math
from typing import Annotated, Literal, TypeVar

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.validated import Positive, Validated

__all__ = ["RadialTrajectory", "SampledTrajectory", "Trajectory"]

MAX_FRAMES = 1_000_000
# of columns, which are long: their sizes are judged by what comes of them
_Entry = Annotated[float, pydantic.Field(gt=0)]
_BOUNDS = pydantic.Field(min_length=1, max_length=MAX_FRAMES, fail_fast=True)
_ENDS = pydantic.Field(min_length=1, max_length=2)
T = TypeVar("T", list[float] | None, list[bool] | None, list[float | None] | None)


class SampledTrajectory(Validated):
    """Ranges as a list.

    Attributes
    ----------
    range_m : list of float
        True range of every frame [m].
    time_s : list of float, optional
        Times [s].
    amplitude : list of float, optional
        Factor on the object's c2 in every frame: an object that turns or crosses the field of
        view at a fixed range.
    object_present : list of bool, optional
        False where the scene is empty.
    known_range_sd_m : list of float or None, optional
        Standard deviation to which the range of every frame is known beside the readings [m]; None
        where it is not.
    temperature_k : list of float, optional
        Temperature of a sensor that has temperature coefficients in every frame [K]. Left out: that
        at which it was calibrated.
    """

    range_m: Annotated[list[_Entry], _BOUNDS]
    time_s: Annotated[list[float], _BOUNDS] | None = None
    amplitude: Annotated[list[_Entry], _BOUNDS] | None = None
    object_present: Annotated[list[bool], _BOUNDS] | None = None
    known_range_sd_m: Annotated[list[_Entry | None], _BOUNDS] | None = None
    temperature_k: Annotated[list[_Entry], _BOUNDS] | None = None

    @pydantic.field_validator(
        "time_s", "amplitude", "object_present", "known_range_sd_m", "temperature_k"
    )
    @classmethod
    def _as_long_as_the_ranges(cls, column: T, info: pydantic.ValidationInfo) -> T:
        ranges = info.data.get("range_m")  # missing where it is wrong itself
        if column is not None and ranges is not None and len(column) != len(ranges):
            raise ValueError(f"has {len(column)} entries where range_m has {len(ranges)}")
        return column

    def ranges(self) -> NDArray[np.float64]:
        """Return the ranges [m], shape (n,)."""
        return np.asarray(self.range_m)

    def times(self) -> NDArray[np.float64] | None:
        """Return the times [s], shape (n,), or None."""
        return None if self.time_s is None else np.asarray(self.time_s)

    def known_range_sds(self) -> NDArray[np.float64] | None:
        """Return to what the ranges are known [m], nan where they are not, shape (n,), or None."""
        sds = self.known_range_sd_m
        return None if sds is None else np.array(sds, dtype=np.float64)

    def temperatures(self) -> NDArray[np.float64] | None:
        """Return the temperatures [K], shape (n,), or None."""
        return None if self.temperature_k is None else np.asarray(self.temperature_k)


class RadialTrajectory(Validated):
    """Straight towards the sensor or away from it.

    Attributes
    ----------
    from_m, to_m : float
        First and last range [m].
    frames : int
        Number of frames.
    spacing : "linear" or "log"
        Whether the range or its logarithm grows evenly.
    duration_s : float, optional
        Time from the first to the last frame [s]; left out: 0.01 s a frame.
    known_range_sd_m : float, optional
        Standard deviation to which every range is known beside the readings [m].
    temperature_k : list of float, optional
        Temperature of a sensor that has temperature coefficients [K]: one of all frames, or those
        of the first and the last, between which it changes evenly. Left out: that at which it was
        calibrated.
    """

    kind: Literal["radial"] = "radial"
    from_m: Positive
    to_m: Positive
    frames: Annotated[int, pydantic.Field(ge=1, le=MAX_FRAMES)]
    spacing: Literal["linear", "log"] = "linear"
    duration_s: Positive | None = None
    known_range_sd_m: Positive | None = None
    temperature_k: Annotated[list[Positive], _ENDS] | None = None

    def ranges(self) -> NDArray[np.float64]:
        """Return the ranges [m], shape (n,)."""
        if self.spacing == "log":
            logs = np.linspace(math.log(self.from_m), math.log(self.to_m), self.frames)
            return np.exp(logs)
        return np.linspace(self.from_m, self.to_m, self.frames)

    def times(self) -> NDArray[np.float64]:
        """Return the times [s], shape (n,)."""
        duration = 0.01 * (self.frames - 1) if self.duration_s is None else self.duration_s
        return np.linspace(0.0, duration, self.frames)

    def known_range_sds(self) -> NDArray[np.float64] | None:
        """Return to what the ranges are known [m], shape (n,), or None."""
        sd = self.known_range_sd_m
        return None if sd is None else np.full(self.frames, sd)

    def temperatures(self) -> NDArray[np.float64] | None:
        """Return the temperatures [K], shape (n,), or None."""
        given = self.temperature_k
        return None if given is None else np.linspace(given[0], given[-1], self.frames)


def _kind(value: object) -> str:
    """Tell which form a trajectory has: its members do, where no `kind` is stated."""
    if isinstance(value, dict):
        ends = "from_m" in value or "to_m" in value
        return "radial" if "kind" in value or (ends and "range_m" not in value) else "sampled"
    return "radial" if isinstance(value, RadialTrajectory) else "sampled"


Trajectory = Annotated[
    Annotated[SampledTrajectory, pydantic.Tag("sampled")]
    | Annotated[RadialTrajectory, pydantic.Tag("radial")],
    pydantic.Discriminator(_kind),
]
