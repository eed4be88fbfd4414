"""What adapters of sine-wave sensors have in common: noise, the sense of q, invalid frames."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from service.adapters.adapter import Converted, Settings
from service.adapters.registers import Registers
from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import RefusedError
from simulator.sensor import Noise, SineWaveSensor

__all__ = ["Pair", "dropped", "offset_note", "phase_of", "sine_wave_frames", "turned"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Pair = tuple[float, float]

_FEWEST = 16  # frames: the scatter of 14 second differences is known to a fifth
_NORMAL_MAD = 1.4826  # standard deviation over median absolute deviation
# phases of an object that moved less tell nothing of the sense of rotation
_MOVED = 1e-3
_OFFSET = 0.01  # rad, as the measure of what an unknown phase offset costs


def dropped(registers: Registers, bad: Mapping[str, Flags]) -> tuple[Registers, tuple[str, ...]]:
    """Leave out frames that the sensor itself calls invalid.

    Parameters
    ----------
    registers : Registers
        Of n frames.
    bad : mapping of str to ndarray of bool, shape (n,)
        By reason, which frames are invalid.

    Returns
    -------
    registers : Registers
        The others.
    notes : tuple of str
        How many were left out, why, and the first of them.

    Raises
    ------
    RefusedError
        Where none is left.
    """
    notes = []
    out = np.zeros(len(registers), dtype=bool)
    for reason, rows in bad.items():
        if rows.any():
            first = int(np.flatnonzero(rows)[0])
            notes.append(
                f"left out {np.count_nonzero(rows)} frames, the first is frame {first}: {reason}"
            )
        out |= rows
    if out.all():
        raise RefusedError(f"no frame is left: {'; '.join(notes)}")
    return registers.select(~out), tuple(notes)


def phase_of(register: NDArray[np.int64]) -> Array:
    """Return the phases of a register whose 65536 steps are a turn [rad]."""
    return np.asarray(2 * np.pi / 65536 * register, dtype=np.float64)


def _scatter(readings: Array, step: Pair) -> Pair:
    """Estimate the noise of readings from their second differences.

    These are free of a steady motion; whatever else moves from frame to frame adds to the noise,
    so that it is rather too large.

    Parameters
    ----------
    readings : ndarray, shape (n, 2)
        Readings in the order of time.
    step : (float, float)
        Of the readings: rounding is noise of a twelfth of its square.

    Returns
    -------
    (float, float)
        Standard deviations.

    Raises
    ------
    RefusedError
        Of fewer than 16 frames.
    """
    if len(readings) < _FEWEST:
        raise RefusedError(
            f"the noise of {len(readings)} frames cannot be told from their scatter: state it "
            f"as read (--read SD SD), or convert {_FEWEST} frames or more"
        )
    second = np.diff(readings, n=2, axis=0)
    sd = _NORMAL_MAD * np.median(np.abs(second), axis=0) / np.sqrt(6.0)
    sd = np.hypot(sd, np.asarray(step) / np.sqrt(12.0))
    return float(sd[0]), float(sd[1])


def turned(readings: Array, phase_rad: Array) -> tuple[Array, tuple[str, ...]]:
    """Turn q by the sensor's own phase, which grows with the range and so tells its sign.

    Parameters
    ----------
    readings : ndarray, shape (n, 2)
        i and q.
    phase_rad : ndarray, shape (n,)
        The sensor's phase, up to a constant [rad].

    Returns
    -------
    readings : ndarray, shape (n, 2)
        i and q as in i + j q = modulus exp(j phase).
    notes : tuple of str
        Where q was turned, or where the phases do not tell.
    """
    angle = np.arctan2(readings[:, 1], readings[:, 0])
    apart = [1.0 - abs(np.mean(np.exp(1j * (phase_rad - sign * angle)))) for sign in (1, -1)]
    if max(apart) < _MOVED:
        note = "the phase hardly changes: that it grows with q / i is supposed, not seen"
        return readings, (note,)
    if apart[1] < apart[0]:
        note = "q has the other sign than the sensor's phase: it is turned"
        return readings * [1.0, -1.0], (note,)
    return readings, ()


def offset_note(frequency_hz: float) -> str:
    """Return what a phase offset that no dump tells does to ranges, and how to find it.

    Parameters
    ----------
    frequency_hz : float
        Modulation frequency [Hz].
    """
    metres = _OFFSET * SPEED_OF_LIGHT / (4 * np.pi * frequency_hz)
    return (
        f"phase_offset_rad is taken as 0, which no dump tells: {_OFFSET:g} rad of it move every "
        f"range by {metres:.2g} m at {frequency_hz / 1e6:g} MHz, in no answer's sd. Calibrate "
        "with frames of known_range_m and a prior of phase_offset_rad (docs/adapters.md)"
    )


def sine_wave_frames(
    readings: Array,
    registers: Registers,
    frequency_hz: float,
    step: Pair,
    settings: Settings,
    *,
    own_noise: Pair | None = None,
    also: Mapping[str, Array] | None = None,
    notes: tuple[str, ...] = (),
) -> Converted:
    """Put frames of a sine-wave sensor together.

    Their noise is what the settings state, else the sensor's own figure, else their scatter.

    Parameters
    ----------
    readings : ndarray, shape (n, 2)
        i and q [reading units].
    registers : Registers
        With the times, where the dump has any.
    frequency_hz : float
        Modulation frequency [Hz].
    step : (float, float)
        Of the readings.
    settings : Settings
        With the period, and perhaps the noise.
    own_noise : (float, float), optional
        Standard deviations by the sensor's own figure.
    also : mapping of str to ndarray, shape (n,), optional
        Further columns.
    notes : tuple of str
        To hand on, before that on the phase offset.

    Raises
    ------
    RefusedError
        Where nothing states the noise and the frames are too few to tell it.
    """
    read = settings.read or own_noise
    if read is None:
        read = _scatter(readings, step)
        note = "noise from the scatter of the frames; what moved unsteadily is part of it"
        notes = (*notes, note)
    columns: dict[str, list[float]] = {}
    if registers.time_s is not None:
        columns["time_s"] = registers.time_s.tolist()
    elif settings.period_s is not None:
        columns["time_s"] = (settings.period_s * np.arange(len(readings))).tolist()
    columns |= {"i": readings[:, 0].tolist(), "q": readings[:, 1].tolist()}
    columns |= {name: column.tolist() for name, column in (also or {}).items()}
    sensor = SineWaveSensor(frequency_hz=frequency_hz, noise=Noise(read=read))
    return Converted(sensor, columns, (*notes, offset_note(frequency_hz)))
