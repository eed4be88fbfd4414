"""All that a tracker remembers between frames, in memory and as bytes."""

import dataclasses
import struct
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray

from inference.posterior.archive import pack, unpack
from inference.tracking.filter import COUNT
from simulator.errors import InvalidInputError

__all__ = ["TrackState", "check_state", "state_from_bytes", "state_to_bytes"]

Array = NDArray[np.float64]
_KIND = "track state 1"
# what reading an archive raises where bytes are missing or changed
_BROKEN = (
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
    x : ndarray, shape (rows, n), or (rows, n + 1) where crosstalk is learnt
        Means of log r, its rate [1/s] and, if learnt, the crosstalk [units of the noise] and the
        log r at which tangents are taken (`inference.tracking.shared_error`); row 0 is the empty
        scene, rows that are not in use are arbitrary.
    X : ndarray, shape (rows, n, n + p)
        Roots of the covariances (`inference.tracking.square_root`).
    weight : ndarray, shape (rows,)
        Probabilities.
    numbers : ndarray, shape (4,)
        Time of the last frame [s] (nan: none yet), probability of an object of which nothing is
        known yet, running surprise, number of hypotheses.
    signature : str
        Of the tracker that it belongs to.
    """

    x: Array
    X: Array
    weight: Array
    numbers: Array
    signature: str = ""


def state_to_bytes(state: TrackState) -> bytes:
    """Write a state as a numpy archive without pickle; every bit survives."""
    arrays = {"x": state.x, "X": state.X, "weight": state.weight, "numbers": state.numbers}
    return pack({"kind": _KIND, "signature": state.signature}, arrays)


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
        return TrackState(
            arrays["x"], arrays["X"], arrays["weight"], arrays["numbers"], meta["signature"]
        )
    except _BROKEN as error:
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
    for name in ("x", "X", "weight", "numbers"):
        array, wanted = getattr(state, name), getattr(like, name)
        if array.shape != wanted.shape or array.dtype != wanted.dtype:
            raise InvalidInputError.at("/state", f"has an array `{name}` of another shape or type")
    count = state.numbers[COUNT]
    if not (0 <= count < len(state.weight) and count == int(count)):
        raise InvalidInputError.at("/state", "counts hypotheses that it does not have")
