"""Register dumps written from the published formats, byte by byte: the other side of each adapter.

Nothing here is shared with the adapters: positions are written out as in the sources that these
cite, so that a slip in one of the two does not cancel.
"""

import json
import math
import struct
from collections.abc import Callable

__all__ = ["WRITERS", "Written", "afbr_s50", "isl29501", "opt3101", "tmf882x"]

# (bytes of one frame, its row of a CSV by register)
Written = tuple[bytes, dict[str, int]]
TURN = 2 * math.pi


def _mantissa(value: float) -> tuple[int, int]:
    """The finest 16-bit mantissa and power of two that hold a value."""
    exponent = max(0, math.frexp(value)[1] - 15)
    return round(value / 2**exponent), exponent


def isl29501(modulus: float, phase: float, *, gain: int = 1000, sign: int = 1) -> Written:
    """0xD1..0xE7: eight-bit registers, most significant first."""
    i, i_exp = _mantissa(modulus * math.cos(phase))
    q, q_exp = _mantissa(sign * modulus * math.sin(phase))
    steps = round(phase / TURN * 65536) % 65536
    burst = bytearray(0xE7 - 0xD1 + 1)
    for address, value, form in (
        (0xD1, steps, ">H"), (0xD8, steps, ">H"), (0xDA, i_exp, "B"), (0xDB, i, ">h"),
        (0xDD, q_exp, "B"), (0xDE, q, ">h"), (0xE2, 77, "B"), (0xE3, 12, "B"), (0xE6, gain, ">H"),
    ):  # fmt: skip
        struct.pack_into(form, burst, address - 0xD1, value)
    row = {
        "i_raw_exponent": i_exp, "i_raw": i, "q_raw_exponent": q_exp, "q_raw": q, "phase": steps,
        "agc_gain": gain, "ambient_light": 12, "die_temperature": 77,
    }  # fmt: skip
    return bytes(burst), row


def opt3101(
    modulus: float, phase: float, *, channel: int = 1, hdr: int = 0, status: int = 1,
    overload: int = 0, frequency: int = 0, sign: int = 1,
) -> Written:  # fmt: skip
    """0x08, 0x09, 0x0A, 0x3B, 0x3C: 24-bit registers, least significant byte first on the bus."""
    i, q = round(modulus * math.cos(phase)), round(sign * modulus * math.sin(phase))
    steps = round(phase / TURN * 65536) % 65536
    words = (
        steps | hdr << 17 | channel << 18 | status << 20 | frequency << 21 | 1 << 23,
        round(modulus) & 0xFFFF | 2 << 16 | overload << 18,
        3 | 512 << 2 | 2345 << 12,
        i & 0xFFFFFF,
        q & 0xFFFFFF,
    )
    frame = b"".join(struct.pack("<I", word)[:3] for word in words)
    row = {
        "phase_out": steps, "hdr_mode": hdr, "tx_channel": channel, "frame_status": status,
        "mod_freq": frequency, "amp_out": round(modulus) & 0xFFFF, "sig_ovl_flag": overload,
        "phase_overflow_f2": 0, "amb_data": 512, "tmain": 2345, "i": i, "q": q,
    }  # fmt: skip
    return frame, row


def afbr_s50(
    modulus: float,
    phase: float,
    *,
    status: int = 0,
    sna: int = 0xFFFF,
) -> Written:
    """A packed record: Range Q9.22, Phase UQ1.15 of pi, Amplitude UQ12.4, Status, SNA UQ12.4."""
    fixed = round(phase / TURN * 6.25 * 2**22)
    steps, amplitude = round(phase / math.pi * 2**15) % 65536, round(modulus * 16)
    frame = struct.pack("<iHHBH", fixed, steps, amplitude, status, sna)
    row = {"range": fixed, "phase": steps, "amplitude": amplitude, "status": status, "sna": sna}
    return frame, row


def tmf882x(histograms: list[list[int]], bin_width_s: float) -> bytes:
    positions = [{"zone_histograms": [counts]} for counts in histograms]
    return json.dumps({"bin_width_s": bin_width_s, "positions": positions}).encode()


# sine-wave sensors of the registry: how a modulus and a phase stand in their registers
WRITERS: dict[str, Callable[..., Written]] = {
    "isl29501": isl29501,
    "opt3101": opt3101,
    "afbr-s50": afbr_s50,
}
