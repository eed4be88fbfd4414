"""Renesas ISL29501: I and Q as mantissa times a power of two.

Addresses and order of the registers, and the scales of distance and phase, are those of the Linux
kernel's ``drivers/iio/proximity/isl29501.c``; the modulation of 4.5 MHz is the data sheet's
(FN8681) and agrees with that driver's 33.31 m for 65536 steps of distance. That the mantissas are
two's complement and the exponents count powers of two from 0 is taken from how the same file's
crosstalk and correction registers are written; the driver itself does not read I and Q. Unknown to
public sources, and therefore handed on as they stand: the scales of die temperature (the driver's
factor contradicts its own comment) and of the precision register, which is not used as a noise.
"""

import numpy as np

from service.adapters.adapter import Adapter, Converted, Settings
from service.adapters.registers import FORMS, Field, Layout, Registers, registers_of
from service.adapters.sine_waves import Array, phase_of, sine_wave_frames, turned
from simulator.errors import InvalidInputError

__all__ = ["ADAPTER", "LAYOUT"]

_FIRST = 0xD1
_FREQUENCY_HZ = 4.5e6
# 2^31 times a mantissa of 16 bits is more than the product of any amplifier and converter
_GREATEST_EXPONENT = 31

LAYOUT = Layout(
    width=0xE7 - _FIRST + 1,
    order="big",
    fields=(
        Field("distance", 0xD1 - _FIRST, 2),
        Field("precision", 0xD3 - _FIRST, 2),
        Field("magnitude_exponent", 0xD5 - _FIRST, 1),
        Field("magnitude", 0xD6 - _FIRST, 2),
        Field("phase", 0xD8 - _FIRST, 2),
        Field("i_raw_exponent", 0xDA - _FIRST, 1, needed=True),
        Field("i_raw", 0xDB - _FIRST, 2, signed=True, needed=True),
        Field("q_raw_exponent", 0xDD - _FIRST, 1, needed=True),
        Field("q_raw", 0xDE - _FIRST, 2, signed=True, needed=True),
        Field("die_temperature", 0xE2 - _FIRST, 1),
        Field("ambient_light", 0xE3 - _FIRST, 1),
        Field("agc_gain", 0xE6 - _FIRST, 2),
    ),
)
"""Registers 0xD1 to 0xE7 in one burst."""


def _gain(registers: Registers, settings: Settings) -> Array | None:
    """Return the factor of each frame on the gain of the first; None where all are alike."""
    gain = registers.values.get("agc_gain")
    if gain is None or settings.agc == "compensated":
        return None
    if np.all(gain == gain[0]):
        return None
    if settings.agc is None:
        message = (
            "the automatic gain changes between these frames: say whether I and Q grow with its "
            "register (linear) or were divided by it (compensated), which no public source says"
        )
        raise InvalidInputError.at("/agc", message)
    if np.any(gain == 0):
        raise InvalidInputError.at("/agc_gain", "is 0 in a frame: its readings have no gain")
    return np.asarray(gain / gain[0], dtype=np.float64)


def _convert(raw: bytes, form: str, settings: Settings) -> Converted:
    registers = registers_of(raw, form, LAYOUT)
    exponents = np.column_stack([registers["i_raw_exponent"], registers["q_raw_exponent"]])
    for column, name in enumerate(("i_raw_exponent", "q_raw_exponent")):
        beyond = np.flatnonzero(exponents[:, column] > _GREATEST_EXPONENT)
        if beyond.size:
            value = int(exponents[beyond[0], column])
            message = f"frame {beyond[0]}: must be {_GREATEST_EXPONENT} or less, is {value}"
            raise InvalidInputError.at(f"/{name}", message)
    mantissas = np.column_stack([registers["i_raw"], registers["q_raw"]])
    readings = np.ldexp(mantissas.astype(np.float64), exponents)
    notes: tuple[str, ...] = ()
    if "phase" in registers.values:
        readings, notes = turned(readings, phase_of(registers["phase"]))
    also = registers.present("ambient_light", "die_temperature")
    gain = _gain(registers, settings)
    if gain is not None:
        also["gain"] = gain
    first, second = np.ldexp(1.0, exponents.max(axis=0)).tolist()
    return sine_wave_frames(
        readings, registers, _FREQUENCY_HZ, (first, second), settings, also=also, notes=notes
    )


ADAPTER = Adapter(
    name="isl29501",
    title="Renesas ISL29501",
    source="Linux drivers/iio/proximity/isl29501.c; data sheet FN8681",
    forms=FORMS,
    settings=frozenset({"read", "period_s", "agc"}),
    convert=_convert,
)
