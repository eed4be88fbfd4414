"""All that a tracker remembers between frames, in memory and as bytes."""

import dataclasses
import math
import struct
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray

from inference.posterior.archive import unpack
from inference.tracking.hypotheses import COUNT, Hypotheses
from simulator.errors import InvalidInputError

__all__ = ["BROKEN", "TrackState", "check_state", "state_from_bytes", "state_to_bytes"]

_MARK = b"track state 6\n"
# that, a checksum of all that follows, and lengths: of the signature, of the rows, of a mean, of
# both sides of a root, of the numbers
_HEAD = struct.Struct("<14sI6I")
_CHECKED_FROM = len(_MARK) + 4
_NUMBER = np.dtype("<f8")
# how it was written before: a numpy archive, which takes as long as a hundred frames
_ARCHIVED = "track state 3"
# what reading an archive raises where bytes are missing or changed
BROKEN = (
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    OSError,
    EOFError,
    NotImplementedError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclasses.dataclass(frozen=True, eq=False)
class TrackState:
    """The filter's state after a frame.

    Attributes
    ----------
    hypotheses : Hypotheses
        What it knows.
    signature : str
        Of the tracker that it belongs to.
    """

    hypotheses: Hypotheses
    signature: str = ""


def state_to_bytes(state: TrackState) -> bytes:
    """Write a state; every bit survives."""
    of, name = state.hypotheses, state.signature.encode()
    body = b"".join([name, *(np.asarray(array, dtype=_NUMBER).tobytes() for array in of)])
    lengths = len(name), *of.x.shape, *of.X.shape[1:], *of.numbers.shape
    head = _HEAD.pack(_MARK, 0, *lengths)
    checked = zlib.crc32(body, zlib.crc32(head[_CHECKED_FROM:]))
    return _HEAD.pack(_MARK, checked, *lengths) + body


def state_from_bytes(data: bytes) -> TrackState:
    """Read what `state_to_bytes` wrote, today or as an archive.

    Raises
    ------
    InvalidInputError
        At "/state" where the bytes are something else.
    """
    try:
        return _read(data) if data.startswith(_MARK) else _read_archive(data)
    except BROKEN as error:
        raise InvalidInputError.at("/state", "is not the state of a tracker") from error


def _read(data: bytes) -> TrackState:
    _, checked, name, rows, mean, n, columns, numbers = _HEAD.unpack_from(data)
    if zlib.crc32(memoryview(data)[_CHECKED_FROM:]) != checked:
        raise ValueError("bytes have changed")
    at, arrays = _HEAD.size + name, []
    for shape in ((rows, mean), (rows, n, columns), (rows,), (numbers,)):
        array: NDArray[np.float64] = np.frombuffer(data, _NUMBER, math.prod(shape), at)
        arrays.append(array.reshape(shape).astype(np.float64))
        at += array.nbytes
    return TrackState(Hypotheses(*arrays), data[_HEAD.size : _HEAD.size + name].decode())


def _read_archive(data: bytes) -> TrackState:
    meta, arrays = unpack(data)
    if meta["kind"] != _ARCHIVED:
        raise ValueError(meta["kind"])
    return TrackState(Hypotheses(*(arrays[n] for n in Hypotheses._fields)), meta["signature"])


def check_state(state: TrackState, like: TrackState) -> None:
    """Check that the kernels can take a state: they trust shapes and counts.

    Parameters
    ----------
    state : TrackState
        To be checked.
    like : TrackState
        One of the same tracker.

    Raises
    ------
    InvalidInputError
        At "/state".
    """
    pairs = zip(state.hypotheses, like.hypotheses, strict=True)
    for name, (array, wanted) in zip(Hypotheses._fields, pairs, strict=True):
        if array.shape != wanted.shape or array.dtype != wanted.dtype:
            raise InvalidInputError.at("/state", f"has an array `{name}` of another shape or type")
    count = state.hypotheses.numbers[COUNT]
    if not (0 <= count < len(state.hypotheses.weight) and count == int(count)):
        raise InvalidInputError.at("/state", "counts hypotheses that it does not have")
