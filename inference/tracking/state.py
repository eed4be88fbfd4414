"""All that a tracker remembers between frames, in memory and as bytes."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.posterior.archive import pack, unpack
from simulator.errors import InvalidInputError

__all__ = ["TrackState", "state_from_bytes", "state_to_bytes"]

Array = NDArray[np.float64]
_KIND = "track state 1"


@dataclasses.dataclass(frozen=True, eq=False)
class TrackState:
    """The filter's state after a frame.

    Attributes
    ----------
    x : ndarray, shape (rows, n)
        Means of log r, its rate [1/s] and, if learnt, the crosstalk [units of the noise]; row 0 is
        the empty scene, rows that are not in use are arbitrary.
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
    except (ValueError, KeyError, OSError, EOFError) as error:
        raise InvalidInputError.at("/state", "is not the state of a tracker") from error
