"""Texas Instruments OPT3101: I and Q of 24 bits, or amplitude and phase of 16.

The fields are those of TI's SDK (``OPT3101::registers``: phase_out 8[15:0], hdr_mode 8[17],
tx_channel 8[19:18], frame_status 8[20], mod_freq 8[21], amp_out 9[15:0], sig_ovl_flag 9[18],
phase_overflow_f2 9[19], amb_data 10[11:2], tmain 10[23:12]) and of the data sheet SBAS883A (3Bh and
3Ch: the components that IQ_READ_DATA_SEL selects). Three bytes a register, the lowest first, I and
Q in two's complement and 10 MHz are as in Pololu's ``opt3101-arduino``, which reads raw I and Q
with IQ_READ_DATA_SEL = 2. Of TMAIN the scale is not established here: it is handed on as it stands.
The raw components come before the chip's own corrections and scale with its digital gain, which
follows the amplitude unless DIS_AUTO_SCALE is set: set it, or take ``amplitude_phase``.
"""

import numpy as np
from numpy.typing import NDArray

from service.adapters.adapter import Adapter, Converted, Settings
from service.adapters.registers import FORMS, Field, Layout, Registers, registers_of
from service.adapters.sine_waves import dropped, phase_of, sine_wave_frames, turned
from simulator.errors import InvalidInputError

__all__ = ["ADAPTER", "LAYOUT"]

_FREQUENCY_HZ = 10e6
_STEP = (1.0, 1.0)
_FORMS_OF_READINGS = ("iq", "amplitude_phase")

LAYOUT = Layout(
    width=15,
    order="little",
    fields=(
        Field("phase_out", 0, 3, low=0, bits=16),
        Field("hdr_mode", 0, 3, low=17, bits=1),
        Field("tx_channel", 0, 3, low=18, bits=2),
        Field("frame_status", 0, 3, low=20, bits=1),
        Field("mod_freq", 0, 3, low=21, bits=1),
        Field("amp_out", 3, 3, low=0, bits=16),
        Field("sig_ovl_flag", 3, 3, low=18, bits=1),
        Field("phase_overflow_f2", 3, 3, low=19, bits=1),
        Field("amb_data", 6, 3, low=2, bits=10),
        Field("tmain", 6, 3, low=12, bits=12),
        Field("i", 9, 3, signed=True),
        Field("q", 12, 3, signed=True),
    ),
)
"""Registers 0x08, 0x09, 0x0A, 0x3B and 0x3C, as they come over the bus."""

_BAD = {
    "frame_status": (0, "the chip calls it invalid (FRAME_STATUS)"),
    "sig_ovl_flag": (1, "the signal overloads the receiver (SIG_OVL_FLAG)"),
    "phase_overflow_f2": (1, "the phase overflows (PHASE_OVERFLOW_F2)"),
}


def _one_emitter(registers: Registers, settings: Settings) -> Registers:
    """Return the frames of one emitter at one current: others have another gain."""
    channel = registers.values.get("tx_channel")
    if channel is not None:
        if settings.channel is not None:
            chosen = channel == settings.channel
            if not chosen.any():
                found = ", ".join(map(str, np.unique(channel)))
                raise InvalidInputError.at("/channel", f"no frame is of it; there are {found}")
            registers = registers.select(chosen)
        elif np.any(channel != channel[0]):
            raise InvalidInputError.at("/channel", "frames are of several emitters: name one")
    for name, what in (("hdr_mode", "emitter currents"), ("mod_freq", "frequencies")):
        values = registers.values.get(name)
        if values is not None and np.any(values != values[0]):
            raise InvalidInputError.at(f"/{name}", f"frames are of two {what}: convert each alone")
    return registers


def _frequency(registers: Registers, settings: Settings) -> float:
    if settings.frequency_hz is not None:
        return settings.frequency_hz
    if "mod_freq" in registers.values and registers["mod_freq"][0]:
        message = "the frames are of the second frequency (MOD_FREQ): state it"
        raise InvalidInputError.at("/frequency_hz", message)
    return _FREQUENCY_HZ


def _need(registers: Registers, *names: str) -> None:
    for name in names:
        if name not in registers.values:
            raise InvalidInputError.at(f"/{name}", "is missing")


def _readings(registers: Registers, form: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return i and q, and notes on their sense."""
    if form == "amplitude_phase":
        _need(registers, "amp_out", "phase_out")
        amplitude = registers["amp_out"].astype(np.float64)
        phase = phase_of(registers["phase_out"])
        return amplitude[:, None] * np.column_stack([np.cos(phase), np.sin(phase)]), ()
    _need(registers, "i", "q")
    readings = np.column_stack([registers["i"], registers["q"]]).astype(np.float64)
    if "phase_out" not in registers.values:
        return readings, ()
    return turned(readings, phase_of(registers["phase_out"]))


def _convert(raw: bytes, form: str, settings: Settings) -> Converted:
    wanted = settings.readings or "iq"
    if wanted not in _FORMS_OF_READINGS:
        raise InvalidInputError.at("/readings", f"must be {' or '.join(_FORMS_OF_READINGS)}")
    registers = registers_of(raw, form, LAYOUT)
    present = [name for name in _BAD if name in registers.values]
    bad = {_BAD[name][1]: registers[name] == _BAD[name][0] for name in present}
    registers, left_out = dropped(registers, bad)
    registers = _one_emitter(registers, settings)
    readings, said = _readings(registers, wanted)
    return sine_wave_frames(
        readings,
        registers,
        _frequency(registers, settings),
        _STEP,
        settings,
        also=registers.present("amb_data", "tmain"),
        notes=left_out + said,
    )


ADAPTER = Adapter(
    name="opt3101",
    title="TI OPT3101",
    source="TI OPT3101 SDK 0.9.1; data sheet SBAS883A; pololu/opt3101-arduino",
    forms=FORMS,
    settings=frozenset({"read", "period_s", "frequency_hz", "channel", "readings"}),
    convert=_convert,
)
