"""The last answers of a stream, kept in memory."""

from service.streams.answered import before_in
from service.streams.lines import WINDOW, Before, Taken

__all__ = ["Kept"]


class Kept:
    """Answers by their numbers; see `service.streams.lines.Earlier`."""

    def __init__(self) -> None:
        self._answers: dict[int, Before] = {}

    def add(self, taken: Taken) -> None:
        """Keep new answers, and forget what has become too old."""
        self._answers.update(before_in(taken.kept))
        oldest = taken.place.sequence - WINDOW
        while self._answers and (first := next(iter(self._answers))) <= oldest:
            del self._answers[first]

    def answer(self, sequence: int) -> Before | None:
        """See `Earlier.answer`."""
        return self._answers.get(sequence)
