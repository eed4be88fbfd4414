"""Recordings of a single-photon sensor as the frames of a hybrid sensor.

A histogram of arrival times holds more than a hybrid sensor reads, so its readings can be formed
afterwards: with n(t) the photons above the floor and T_p the pulse width, each photon has the late
part t / T_p, so that w2 = sum n(t) and w1 = sum n(t) t / T_p, the first moment; a sine wave reads
i + j q = sum n(t) exp(2 pi j f t). Readings are counts of photons.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from service.adapters.recordings import Recording
from simulator.constants import SPEED_OF_LIGHT
from simulator.frames import Frames
from simulator.sensor import Noise, PulsedSensor, SineWaveSensor

__all__ = ["Calibration", "calibrate", "pulsed", "sine_wave"]

Array = NDArray[np.float64]


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
