"""What is known of one stream."""

import dataclasses
from typing import Any

__all__ = ["StreamChange", "StreamRecord"]


@dataclasses.dataclass(frozen=True, slots=True)
class StreamRecord:
    """How a stream stands: a row of a table.

    Attributes
    ----------
    id : str
        Public name.
    client : str
        To whom it belongs: the name of an API key, empty where there are none.
    arrival : int
        Order of arrival.
    request : bytes
        The request that made it, as JSON.
    number : int
        Counts its changes; every change names the one that it follows.
    state : bytes
        The tracker's state.
    sequence : int
        Number of the last line that was answered; -1 before the first.
    counts : dict
        Of lines by what became of them, and the health of the stream.
    last : bytes
        The last answer, as JSON; empty before the first.
    kept_bytes : int
        Bytes of the answers that are kept.
    touched : float
        When it was last changed [s since 1970].
    holder : str or None
        The process whose client sends to it.
    held_until : float
        How long that counts [s since 1970].
    """

    id: str
    client: str
    arrival: int
    request: bytes
    number: int
    state: bytes
    sequence: int
    counts: dict[str, Any]
    last: bytes
    kept_bytes: int
    touched: float
    holder: str | None
    held_until: float


@dataclasses.dataclass(frozen=True, slots=True)
class StreamChange:
    """What a batch of lines does to a stream.

    Attributes
    ----------
    id : str
        Of the stream.
    number : int
        At which it was seen: where it stands elsewhere by now, nothing is changed.
    state, sequence, counts, last
        As in `StreamRecord`, after the batch.
    answers : bytes
        Those that are new, in whatever form.
    holder : str or None
        Who goes on sending to it; None where the batch was all.
    """

    id: str
    number: int
    state: bytes
    sequence: int
    counts: dict[str, Any]
    last: bytes
    answers: bytes
    holder: str | None
