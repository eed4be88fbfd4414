"""Which number a line has, what is missing before it, and what is said where it came before."""

from typing import Any

from service.errors import ConflictError, GoneError
from service.streams.lines import LARGEST, WINDOW, Before, Earlier, Line
from simulator.errors import InvalidInputError

__all__ = ["answered_before", "missing_before", "number_in"]


def number_in(frame: dict[str, Any], after: int) -> int:
    """Return the number that a line states, or else the one that comes next.

    Raises
    ------
    InvalidInputError
        At "/sequence" where it is none.
    """
    own = frame.get("sequence")
    if own is None:
        return after
    if type(own) is not int or not 0 <= own <= LARGEST:
        raise InvalidInputError.at("/sequence", "must be an integer from 0 to 2^53 - 1")
    return own


def missing_before(gap: int, line: Line) -> dict[str, Any]:
    """Return what is missing before a line."""
    also: dict[str, Any] = {}
    if gap > 0:
        also["gap"] = gap
    if line.dropped:
        also["dropped"] = line.dropped
    return also


def answered_before(found: Earlier | Before, sequence: int, last: int, digest: int) -> bytes:
    """Return what was answered to a number.

    Parameters
    ----------
    found : Earlier or Before
        What was answered to this number, or to all that came before.
    sequence, last : int
        The number, and the last one that was answered before the line came.
    digest : int
        Of what the line says.

    Raises
    ------
    GoneError
        Where that is kept no longer.
    ConflictError
        Where nothing was answered to it, or what was is no answer to this line.
    """
    if sequence <= last - WINDOW:
        raise GoneError(f"{last} was answered before: answers are kept of {WINDOW} numbers")
    before = found if isinstance(found, Before) else found.answer(sequence)
    if before is None:
        raise ConflictError(f"it comes too late: {last} was answered before")
    if before.digest not in (None, digest):
        message = (
            f"{sequence} was answered to a line with other content: go on counting, or, where the "
            "counter began anew, make a new stream"
        )
        raise ConflictError(message, "/sequence")
    return before.answer
