"""What a public function is held to, case by case."""

import math
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["Held", "Worst", "worst_of"]


class Held(NamedTuple):
    """What one public function is held to.

    Attributes
    ----------
    function : str
        Its name.
    by : str
        To what its answers are held.
    condition : str
        What the unit of an error is.
    cases : int
        How many the long table has.
    error : callable
        Of a case's number: its error in these units; None where it is refused, or its reference
        decides nothing.
    """

    function: str
    by: str
    condition: str
    cases: int
    error: Callable[[int], float | None]


class Worst(NamedTuple):
    """The worst of many cases, how many were decided, and its number."""

    decided: int
    error: float
    number: int


def worst_of(held: Held, cases: int) -> Worst:
    """Go through cases; what is not a number is worst of all."""
    found = Worst(0, 0.0, 0)
    for number in range(cases):
        error = held.error(number)
        if error is None:
            continue
        error = math.inf if math.isnan(error) else error
        decided = found.decided + 1
        found = (
            Worst(decided, error, number)
            if error > found.error or decided == 1
            else found._replace(decided=decided)
        )
    return found
