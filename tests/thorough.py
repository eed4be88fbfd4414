"""What takes long and says little more than its small version: `make thorough` runs it all.

`make test` leaves out the tests that are marked so, and takes the first few of many data sets.
"""

import os
from collections.abc import Sequence
from typing import TypeVar

__all__ = ["THOROUGH", "first"]

T = TypeVar("T")

THOROUGH = os.environ.get("TESTS_THOROUGH") == "1"
"""Whether all tests run, with all of their data sets."""


def first(few: int, of: Sequence[T]) -> Sequence[T]:
    """Return the first few data sets, or all of them in `make thorough`."""
    return of if THOROUGH else of[:few]
