"""Recordings of a single-photon sensor as the frames of a hybrid sensor.

A histogram of arrival times holds more than a hybrid sensor reads, so its readings can be formed
afterwards: with n(t) the photons above the floor and T_p the pulse width, each photon has the late
part t / T_p, so that w2 = sum n(t) and w1 = sum n(t) t / T_p, the first moment; a sine wave reads
i + j q = sum n(t) exp(2 pi j f t). Readings are counts of photons.
"""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pydantic
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from service.errors import MalformedError
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.sensor import Noise, PulsedSensor, SineWaveSensor
from simulator.validated import problems_of

__all__ = [
    "Calibration",
    "Recording",
    "calibrate",
    "pulsed",
    "read_recording",
    "recording_of",
    "sine_wave",
]

Array = NDArray[np.float64]
# photons of a bin, perhaps a mean over several histograms
Count = Annotated[float, pydantic.Field(ge=0, le=1e15, allow_inf_nan=False)]
Width = Annotated[float, pydantic.Field(ge=1e-15, le=1e-3)]
Distance = Annotated[float, pydantic.Field(ge=0, le=1e9, allow_inf_nan=False)]
_NAMED = 5  # problems of one file; the others are mostly of the same kind
SPEED_OF_LIGHT: float = speed_of_light  # [m/s]


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


@dataclasses.dataclass(frozen=True)
class Calibration:
    """Affine calibration of a time axis: range = slope c t / 2 + offset.

    Attributes
    ----------
    slope : float
        True width of a bin over the stated one.
    offset_m : float
        Of the instant at which the light leaves [m].
    """

    slope: float = 1.0
    offset_m: float = 0.0

    def __call__(self, range_m: Array) -> Array:
        """Return calibrated ranges [m]."""
        return self.slope * range_m + self.offset_m


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

    Returns
    -------
    Recording

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


def calibrate(range_m: Array, truth_m: Array) -> Calibration:
    """Fit an affine calibration by least squares.

    Parameters
    ----------
    range_m, truth_m : ndarray, shape (n,)
        Measured and true ranges [m].
    """
    centre = range_m.mean()
    columns = np.column_stack([range_m - centre, np.ones(range_m.size)])
    slope, height = np.linalg.lstsq(columns, truth_m)[0]
    return Calibration(float(slope), float(height - slope * centre))


def _frames(recording: Recording, readings: Array, speed_m_s: float) -> Frames:
    start = recording.distance_m[0]
    time_s = (recording.distance_m - start) / speed_m_s
    return Frames(readings, time_s=None if np.isnan(time_s).any() else time_s)


def _noise(recording: Recording, weights: Array) -> Noise:
    """Noise of weighted sums of photons, that of the worst position.

    How many photons come is a relative error that both sums share, since nearly all of them carry
    the same weights; how the weights spread within an echo and what the floor leaves (its own
    photons, and the error of its mean, that all bins share) is each sum's own.
    """
    bins = Recording.FLOOR_BINS.stop - Recording.FLOOR_BINS.start
    signal, photons = np.maximum(recording.signal, 0.0), recording.signal.sum(axis=1)
    # an empty floor still rounds to whole photons
    floor = np.maximum(recording.floor, 1.0 / bins)
    read = []
    for column in weights.T:
        mean = signal @ column / photons
        spread = np.sum(signal * (column - mean[:, None]) ** 2, axis=1)
        # a photon of the floor bins also counts against every bin, by the mean
        net = column.copy()
        net[Recording.FLOOR_BINS] -= column.sum() / bins
        left = floor * np.sum(net**2)
        read.append(float(np.sqrt(np.max(spread + left))))
    return Noise(read=(read[0], read[1]), relative=float(1 / np.sqrt(photons.min())))


def pulsed(
    recording: Recording,
    calibration: Calibration | None = None,
    gain: float = 1.0,
    speed_m_s: float = 0.1,
) -> tuple[PulsedSensor, Frames]:
    """Form the readings of a pulsed sensor whose pulse is as long as the histogram.

    Parameters
    ----------
    recording : Recording
        The histograms.
    calibration : Calibration, optional
        Of the time axis; left out, ranges start with the histogram.
    gain : float
        Of the sensor: photons per Phi / (Phi0 A_D) [m^2].
    speed_m_s : float
        Of the object [m/s]: the clock of the frames. No answer depends on it.

    Returns
    -------
    sensor : PulsedSensor
        Its noise is that of counted photons. ``relative`` stands for their number and not
        ``shot``, which is the noise of windows: a window takes a photon whole or not at all, a
        first moment takes its share.
    frames : Frames
        w1, w2 [photons].
    """
    calibration = calibration or Calibration()
    r0 = 0.5 * SPEED_OF_LIGHT * recording.span_s
    late = calibration(recording.bin_range_m) / r0
    weights = np.column_stack([late, np.ones_like(late)])
    sensor = PulsedSensor(
        pulse_width_s=recording.span_s, gain=gain, noise=_noise(recording, weights)
    )
    return sensor, _frames(recording, recording.signal @ weights, speed_m_s)


def sine_wave(
    recording: Recording,
    calibration: Calibration | None = None,
    gain: float = 1.0,
    speed_m_s: float = 0.1,
    frequency_hz: float = 5e6,
) -> tuple[SineWaveSensor, Frames]:
    """Form the readings of a sine-wave sensor; parameters as for `pulsed`.

    Parameters
    ----------
    recording, calibration, gain, speed_m_s
        As for `pulsed`.
    frequency_hz : float
        Modulation frequency [Hz].

    Returns
    -------
    sensor : SineWaveSensor
        With noise as for `pulsed`.
    frames : Frames
        i, q [photons].
    """
    calibration = calibration or Calibration()
    wave_number = 4 * np.pi * frequency_hz / SPEED_OF_LIGHT
    phase = wave_number * calibration(recording.bin_range_m)
    weights = np.column_stack([np.cos(phase), np.sin(phase)])
    noise = _noise(recording, weights)
    sensor = SineWaveSensor(frequency_hz=frequency_hz, gain=gain, noise=noise)
    return sensor, _frames(recording, recording.signal @ weights, speed_m_s)
