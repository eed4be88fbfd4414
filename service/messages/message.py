"""The template of a message of another system."""

import dataclasses
from collections.abc import Callable
from typing import Any

from service.messages.measured import Measured

__all__ = ["Message"]


@dataclasses.dataclass(frozen=True, slots=True)
class Message:
    """One form of a range.

    Attributes
    ----------
    name : str
        As that system calls it.
    media_type : str
        As in ``Accept`` and ``Content-Type``: JSON with the fields of the message.
    write : callable
        Measured -> the fields by their names, in values that JSON has.
    """

    name: str
    media_type: str
    write: Callable[[Measured], dict[str, Any]]
