"""Recordings of a single-photon sensor: histograms of arrival times, read from JSON."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pydantic
from numpy.typing import NDArray

from service.errors import MalformedError
from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import InvalidInputError
from simulator.validated import problems_of

__all__ = ["Recording", "read_recording", "recording_of"]

Array = NDArray[np.float64]
# photons of a bin, perhaps a mean over several histograms
Count = Annotated[float, pydantic.Field(ge=0, le=1e15, allow_inf_nan=False)]
Width = Annotated[float, pydantic.Field(ge=1e-15, le=1e-3)]
Distance = Annotated[float, pydantic.Field(ge=0, le=1e9, allow_inf_nan=False)]
_NAMED = 5  # problems of one file; the others are mostly of the same kind


class _Position(pydantic.BaseModel, strict=True):
    distance_m: Distance | None = None
    zone_histograms: Annotated[list[list[Count]], pydantic.Field(min_length=1)]


class _File(pydantic.BaseModel, strict=True):
    bin_width_s: Width
    positions: Annotated[list[_Position], pydantic.Field(min_length=1)]


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """Histograms of one object at n positions, all zones of the sensor pooled.

    Attributes
    ----------
    distance_m : ndarray, shape (n,)
        True distances [m], ascending; nan where the file has none, positions then in its order.
    counts : ndarray, shape (n, bins)
        Photons in each bin.
    bin_width_s : float
        Width of a bin [s].
    """

    distance_m: Array
    counts: Array
    bin_width_s: float

    # the last of 128 bins lie 9 ns behind the start: beyond every echo of these recordings
    FLOOR_BINS = slice(100, 128)

    @property
    def floor(self) -> Array:
        """Mean count of a bin without signal, shape (n,)."""
        return np.asarray(self.counts[:, self.FLOOR_BINS].mean(axis=1), dtype=np.float64)

    @property
    def signal(self) -> Array:
        """Counts above the floor, shape (n, bins)."""
        return self.counts - self.floor[:, None]

    @property
    def span_s(self) -> float:
        """Length of a histogram [s]."""
        return float(self.bin_width_s * self.counts.shape[1])

    @property
    def bin_range_m(self) -> Array:
        """Range from which a photon in the middle of each bin comes, c t / 2 [m]."""
        middle = np.arange(self.counts.shape[1], dtype=np.float64) + 0.5
        return 0.5 * SPEED_OF_LIGHT * self.bin_width_s * middle

    def select(self, index: "NDArray[np.bool_] | slice") -> "Recording":
        """Return the positions that a numpy index selects."""
        return dataclasses.replace(
            self, distance_m=self.distance_m[index], counts=self.counts[index]
        )


def read_recording(path: Path) -> Recording:
    """Read a file of histograms with their distances; see `recording_of`.

    Raises
    ------
    OSError
        Where it cannot be opened.
    MalformedError
        As `recording_of`, naming the file.
    InvalidInputError
        Where a position has no distance.
    """
    try:
        recording = recording_of(path.read_bytes())
    except InvalidInputError as error:
        raise MalformedError(f"{path}: {error}") from None
    if np.isnan(recording.distance_m).any():
        raise InvalidInputError.at("/positions", "each must have a distance_m")
    return recording


def recording_of(raw: bytes) -> Recording:
    """Read histograms and pool the zones.

    Parameters
    ----------
    raw : bytes
        JSON with ``bin_width_s`` and ``positions``, each with ``zone_histograms`` and, where it is
        known, ``distance_m``.

    Raises
    ------
    InvalidInputError
        Naming the field that is missing or no such number, or the histogram whose length is not
        that of the others; where it is not JSON, the place.
    """
    try:
        file = _File.model_validate_json(raw)
    except pydantic.ValidationError as error:
        raise InvalidInputError(*problems_of(error, _plain(raw))[:_NAMED]) from None
    _check_lengths(file)
    distance = np.array([p.distance_m for p in file.positions], dtype=np.float64)
    counts = np.array([p.zone_histograms for p in file.positions], dtype=np.float64).sum(axis=1)
    order = np.argsort(distance, kind="stable")
    if np.isnan(distance).any():
        order = np.arange(distance.size)
    return Recording(distance[order], counts[order], file.bin_width_s)


def _plain(raw: bytes) -> Any:
    """Return decoded JSON, by which pointers are found; None where it is none."""
    try:
        return json.loads(raw)
    except (ValueError, RecursionError):
        return None


def _check_lengths(file: _File) -> None:
    zones = file.positions[0].zone_histograms
    least = Recording.FLOOR_BINS.stop
    for k, position in enumerate(file.positions):
        at = f"/positions/{k}/zone_histograms"
        if len(position.zone_histograms) != len(zones):
            message = f"has {len(position.zone_histograms)} zones, position 0 has {len(zones)}"
            raise InvalidInputError.at(at, message)
        for j, histogram in enumerate(position.zone_histograms):
            if len(histogram) < least or len(histogram) != len(zones[0]):
                message = f"has {len(histogram)} bins; all must have as many, {least} or more"
                raise InvalidInputError.at(f"{at}/{j}", message)
