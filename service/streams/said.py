"""What a track says of frames as numbers: a quarter of the bytes of its text, and kept as such.

The text follows from the numbers, so that an answer that is asked for again is the same byte for
byte (`service.streams.answered`).
"""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.track import Track

__all__ = ["MARKS", "OWN", "Said", "said_from_bytes", "said_of", "said_to_bytes"]

MARKS = (b"\1", b"\0")
"""First bytes of what `said_to_bytes` writes, and wrote; no JSON text begins with them."""

OWN = 9
"""Rows of `Said.table` that every frame has, before those of its hypotheses."""

_HEAD = struct.Struct("<cIIQ")


class Said(NamedTuple):
    """What is said of n frames.

    Attributes
    ----------
    sequence : ndarray of int64, shape (n,)
        Their numbers.
    time_s : ndarray, shape (n,)
        Their times [s].
    status : ndarray of uint8, shape (n,)
        `Status`.
    misfit : ndarray of bool, shape (n,)
        Of the tracker's surprise.
    hypotheses : ndarray of uint8, shape (n,)
        How many there are.
    table : ndarray, shape (9 + 3 k, n)
        Range, standard deviation and its three parts, probabilities of an object and of an
        outlier, rate, latency; of each of k hypotheses range, standard deviation, weight.
    more : tuple of str
        Of each frame JSON text of further members, each after a comma; empty where none has any.
    """

    sequence: NDArray[np.int64]
    time_s: NDArray[np.float64]
    status: NDArray[np.uint8]
    misfit: NDArray[np.bool_]
    hypotheses: NDArray[np.uint8]
    table: NDArray[np.float64]
    more: tuple[str, ...]


def said_of(
    track: Track,
    sequences: Sequence[int],
    times: Sequence[float] | NDArray[np.float64],
    latencies: NDArray[np.float64],
    more: tuple[str, ...] = (),
) -> Said:
    """Return what a track says of each frame.

    Parameters
    ----------
    track : Track
        Of n frames.
    sequences, times : sequence of int or float
        Of each of them.
    latencies : ndarray, shape (n,)
        Of each of them [s].
    more : tuple of str
        See `Said`.
    """
    width = track.hypotheses_m.shape[1]
    table = np.empty((OWN + 3 * width, len(track)))
    sd = track.sd_m
    table[0], table[1] = track.range_m, sd
    for row, part in zip(table[2:5], track.sd_parts_m, strict=True):
        row[:] = np.where(np.isfinite(sd), part, np.nan)
    table[5], table[6], table[7] = track.present, track.outlier, track.rate_m_s
    table[8] = latencies
    table[OWN::3] = track.hypotheses_m.T
    table[OWN + 1 :: 3] = track.hypotheses_sd_m.T
    table[OWN + 2 :: 3] = track.hypotheses_weight.T
    if isinstance(sequences, range):  # its numbers are not looked at one by one
        sequence = np.arange(sequences.start, sequences.stop, dtype=np.int64)
    else:
        sequence = np.array(sequences, dtype=np.int64)
    return Said(
        sequence,
        np.array(times, dtype=np.float64),
        track.status,
        track.misfit,
        np.isfinite(track.hypotheses_m).sum(axis=1, dtype=np.uint8),
        table,
        more,
    )


def said_to_bytes(said: Said) -> bytes:
    """Return it as bytes for a store.

    Of a row of the table that is the same in all frames one number is kept, and of hypotheses those
    that there are.
    """
    text = "\n".join(said.more).encode()
    bits = said.table.view(np.int64)
    same = (bits == bits[:, :1]).all(axis=1)
    head = _HEAD.pack(MARKS[0], len(said.sequence), len(said.table), len(text))
    parts = [head, *(array.tobytes() for array in said[:5]), same.tobytes()]
    for row, (values, alike) in enumerate(zip(said.table, same.tolist(), strict=True)):
        parts.append((values[:1] if alike else values[_present(said.hypotheses, row)]).tobytes())
    return b"".join([*parts, text])


def said_from_bytes(data: bytes) -> Said:
    """Read what `said_to_bytes` wrote, today or with all numbers of the table."""
    mark, n, rows, length = _HEAD.unpack_from(data)
    at = _HEAD.size
    arrays: list[NDArray[Any]] = []
    for kind in (np.int64, np.float64, np.uint8, np.bool_, np.uint8):
        arrays.append(np.frombuffer(data, dtype=kind, count=n, offset=at))
        at += arrays[-1].nbytes
    sequence, time_s, status, misfit, hypotheses = arrays
    table = np.full((rows, n), np.nan)
    same = np.zeros(rows, dtype=np.bool_)
    if mark == MARKS[0]:
        same = np.frombuffer(data, dtype=np.bool_, count=rows, offset=at)
        at += same.nbytes
    for row, alike in enumerate(same.tolist()):
        which = _present(hypotheses, row) if mark == MARKS[0] and not alike else slice(None)
        size = 1 if alike else table[row, which].size
        table[row, which] = np.frombuffer(data, dtype=np.float64, count=size, offset=at)
        at += 8 * size
    text = data[at : at + length].decode()
    more = tuple(text.split("\n")) if length else ()
    return Said(sequence, time_s, status, misfit, hypotheses, table, more)


def _present(hypotheses: NDArray[np.uint8], row: int) -> Any:
    """Return which frames have a number in a row of the table; nan stands in all others."""
    return slice(None) if row < OWN else hypotheses > (row - OWN) // 3
