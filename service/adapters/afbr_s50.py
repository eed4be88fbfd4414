"""Broadcom AFBR-S50: amplitude and phase of one pixel, as its API hands them out.

Formats and meaning are those of ``argus_px.h`` and ``argus_res.h`` of the API: Phase UQ1.15 in
units of pi, Amplitude UQ12.4 (0: no data, 0xFFFF: overflow), Range Q9.22 in metres, status bits,
and SNA, the shot noise amplitude in UQ12.4 (0xFFFF: none), an average over passive pixels. A pixel
without light reads the modulus of two noisy components, whose mean is sqrt(pi / 2) times the
standard deviation of one: that is the sensor's own figure of its noise. How the API's C structure
lies in memory is its compiler's affair; a ``.bin`` or ``.hex`` frame here is therefore a packed
record of its members, the lowest byte first: Range (4 bytes), Phase (2), Amplitude (2), Status (1),
SNA (2). The modulation frequency is in no result and must be stated.
"""

import math

import numpy as np

from service.adapters.adapter import Adapter, Converted, Settings
from service.adapters.registers import FORMS, Field, Layout, Registers, registers_of
from service.adapters.sine_waves import Pair, dropped, phase_of, sine_wave_frames, turned
from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import InvalidInputError

__all__ = ["ADAPTER", "LAYOUT"]

_OVERFLOW = 0xFFFF
_LSB = 1 / 16  # of UQ12.4

LAYOUT = Layout(
    width=11,
    order="little",
    fields=(
        Field("range", 0, 4, signed=True),
        Field("phase", 4, 2, needed=True),
        Field("amplitude", 6, 2, needed=True),
        Field("status", 8, 1),
        Field("sna", 9, 2),
    ),
)

# bits of argus_px_status_t that leave no reading; weak signals and wrong windows are readings
_BAD_STATUS = {
    0x01: "the pixel is off (PIXEL_OFF)",
    0x02: "the pixel is saturated (PIXEL_SAT)",
    0x08: "its data are invalid (PIXEL_INVALID)",
    0x10: "the pixel is masked out (PIXEL_PREFILTERED)",
    0x80: "it repeats an earlier frame (PIXEL_STALLED)",
}


def _own_noise(registers: Registers) -> Pair | None:
    """Return the noise by the shot noise monitor, that of the worst frame; None without one."""
    if "sna" not in registers.values:
        return None
    known = registers["sna"][registers["sna"] != _OVERFLOW]
    if known.size == 0 or known.max() == 0:
        return None
    sd = math.hypot(float(known.max()) * _LSB / math.sqrt(math.pi / 2), _LSB / math.sqrt(12))
    return sd, sd


def _convert(raw: bytes, form: str, settings: Settings) -> Converted:
    if settings.frequency_hz is None:
        raise InvalidInputError.at("/frequency_hz", "must be stated: no result holds it")
    registers = registers_of(raw, form, LAYOUT)
    amplitude = registers["amplitude"]
    bad = {
        "it has no amplitude": amplitude == 0,
        "its amplitude overflows": amplitude == _OVERFLOW,
    }
    if "status" in registers.values:
        status = registers["status"]
        bad |= {reason: (status & bit) != 0 for bit, reason in _BAD_STATUS.items()}
    registers, notes = dropped(registers, bad)
    phase = phase_of(registers["phase"])
    modulus = _LSB * registers["amplitude"]
    readings = modulus[:, None] * np.column_stack([np.cos(phase), np.sin(phase)])
    if "range" in registers.values:
        wave_number = 4 * np.pi * settings.frequency_hz / SPEED_OF_LIGHT
        range_m = np.ldexp(registers["range"], -22)
        readings, said = turned(readings, wave_number * range_m)
        notes += said
    own = _own_noise(registers)
    return sine_wave_frames(
        readings,
        registers,
        settings.frequency_hz,
        (_LSB, _LSB),
        settings,
        own_noise=own,
        notes=notes,
    )


ADAPTER = Adapter(
    name="afbr-s50",
    title="Broadcom AFBR-S50",
    source="Broadcom AFBR-S50 API: argus_px.h, argus_res.h",
    forms=FORMS,
    settings=frozenset({"read", "period_s", "frequency_hz"}),
    convert=_convert,
)
