"""How long a report still takes: each kind of method at its own pace, compiling apart."""

import dataclasses
from collections.abc import Iterable

from service.report.cells import Cell

__all__ = ["Pace", "Spent"]

# what was foreseen of a kind before what it took counts as much as what others took [s]
_LEARNT_S = 10.0


@dataclasses.dataclass(frozen=True)
class Spent:
    """What measuring took.

    Attributes
    ----------
    measurements : int
        How many.
    processor_s : float
        Processor time of all, compiling apart [s].
    compiling_s : float
        Processor time of compiling [s].
    """

    measurements: int = 0
    processor_s: float = 0.0
    compiling_s: float = 0.0

    def plus(self, seconds: float, compiling_s: float) -> "Spent":
        """Return it with one more measurement."""
        return Spent(
            self.measurements + 1, self.processor_s + seconds, self.compiling_s + compiling_s
        )


class Pace:
    """What was foreseen and what it took, by kind of method."""

    def __init__(self) -> None:
        self._foreseen: dict[str, float] = {}
        self._took: dict[str, float] = {}

    def learn(self, cell: Cell, seconds: float) -> None:
        """Take in what a cell took, compiling apart [s]."""
        kind = cell.family
        self._foreseen[kind] = self._foreseen.get(kind, 0.0) + cell.seconds
        self._took[kind] = self._took.get(kind, 0.0) + seconds

    def left_s(self, cells: Iterable[Cell]) -> float:
        """Return what cells will take, compiling apart [s]."""
        ahead: dict[str, float] = {}
        for cell in cells:
            ahead[cell.family] = ahead.get(cell.family, 0.0) + cell.seconds
        together = self._of(sum(self._took.values()), sum(self._foreseen.values()), 1.0)
        return sum(
            seconds * self._of(self._took.get(kind, 0.0), self._foreseen.get(kind, 0.0), together)
            for kind, seconds in ahead.items()
        )

    @staticmethod
    def _of(took: float, foreseen: float, before: float) -> float:
        return (took + before * _LEARNT_S) / (foreseen + _LEARNT_S)
