"""Which number a line has, and what is missing before it."""

from typing import Any

from service.streams.lines import LARGEST, Line
from simulator.errors import InvalidInputError

__all__ = ["missing_before", "number_in"]


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
