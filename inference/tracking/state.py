"""All that a tracker remembers between frames, in memory and as bytes."""

import dataclasses
import struct
import zipfile
import zlib

from inference.posterior.archive import pack, unpack
from inference.tracking.hypotheses import COUNT, Hypotheses
from simulator.errors import InvalidInputError

__all__ = ["BROKEN", "TrackState", "check_state", "state_from_bytes", "state_to_bytes"]

_KIND = "track state 3"
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
    """Write a state as a numpy archive without pickle; every bit survives."""
    return pack({"kind": _KIND, "signature": state.signature}, state.hypotheses._asdict())


def state_from_bytes(data: bytes) -> TrackState:
    """Read what `state_to_bytes` wrote.

    Raises
    ------
    InvalidInputError
        At "/state" where the bytes are something else.
    """
    try:
        meta, arrays = unpack(data)
        if meta["kind"] != _KIND:
            raise ValueError(meta["kind"])
        hypotheses = Hypotheses(*(arrays[name] for name in Hypotheses._fields))
        return TrackState(hypotheses, meta["signature"])
    except BROKEN as error:
        raise InvalidInputError.at("/state", "is not the state of a tracker") from error


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
