"""ams TMF882x: histograms of arrival times as the readings of a hybrid sensor.

The readings are formed as in `service.adapters.histograms`. How histograms leave the chip is the
affair of its firmware and driver, and is not read here: a dump is JSON with ``bin_width_s`` and
``positions``, one a frame, each with ``zone_histograms`` (counts a bin, a list a zone, 128 bins or
more) and perhaps ``distance_m``. Ranges start with the histogram: the instant at which the light
leaves is an offset that nothing in a dump says.
"""

import numpy as np

from service.adapters.adapter import Adapter, Converted, Settings
from service.adapters.histograms import pulsed, sine_wave
from service.adapters.recordings import recording_of
from service.adapters.sine_waves import offset_note
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["ADAPTER"]

_FORMS_OF_READINGS = ("pulsed", "sine_wave")


def _convert(raw: bytes, form: str, settings: Settings) -> Converted:
    del form  # one only
    wanted = settings.readings or "pulsed"
    if wanted not in _FORMS_OF_READINGS:
        raise InvalidInputError.at("/readings", f"must be {' or '.join(_FORMS_OF_READINGS)}")
    recording = recording_of(raw)
    dark = np.flatnonzero(recording.signal.sum(axis=1) < 1.0)
    if dark.size:
        raise RefusedError(
            f"frame {dark[0]} has no photon above its floor, so that their noise cannot be told"
        )
    if wanted == "sine_wave":
        if settings.frequency_hz is None:
            raise InvalidInputError.at("/frequency_hz", "must be stated for readings sine_wave")
        made: tuple[Sensor, Frames] = sine_wave(recording, frequency_hz=settings.frequency_hz)
    elif settings.frequency_hz is not None:
        raise InvalidInputError.at("/frequency_hz", "belongs to readings sine_wave")
    else:
        made = pulsed(recording)
    sensor, frames = made
    columns = {
        name: column for name, column in frames.to_columns(sensor).items() if name != "time_s"
    }
    if settings.period_s is not None:
        time_s = settings.period_s * np.arange(len(frames))
        columns = {"time_s": time_s.tolist(), **columns}
    offset = "timing_offset_s" if wanted == "pulsed" else "phase_offset_rad"
    note = (
        "ranges start with the histogram: an offset of the instant of emission is in all of them. "
        f"Calibrate with frames of known_range_m and a prior of {offset} (docs/adapters.md)"
    )
    notes = (note,) if settings.frequency_hz is None else (note, offset_note(settings.frequency_hz))
    return Converted(sensor, columns, notes)


ADAPTER = Adapter(
    name="tmf882x",
    title="ams TMF882x",
    source="histograms as JSON, docs/adapters.md",
    forms=(".json",),
    settings=frozenset({"period_s", "frequency_hz", "readings"}),
    convert=_convert,
)
