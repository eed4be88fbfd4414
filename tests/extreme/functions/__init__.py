"""Every public function that computes, and what it is held to: the table of docs/stability.md."""

from tests.extreme.functions.documents import DOCUMENTS
from tests.extreme.functions.folds import FOLDS
from tests.extreme.functions.held import Held, Worst, worst_of
from tests.extreme.functions.light import LIGHT
from tests.extreme.functions.roots import ROOTS
from tests.extreme.functions.streams import STREAMS

__all__ = ["FUNCTIONS", "Held", "Worst", "table_row", "worst_of"]

FUNCTIONS: tuple[Held, ...] = (*DOCUMENTS, *LIGHT, *ROOTS, *FOLDS, *STREAMS)


def table_row(held: Held, cases: int) -> tuple[str, Worst]:
    """Go through the cases of a function; return its row of the table, and the worst case."""
    worst = worst_of(held, cases)
    name, _, rest = held.function.partition(", ")
    cells = (
        f"`{name}`{rest and f', {rest}'}",
        held.by,
        f"{worst.decided:,} of {cases:,}",
        held.condition,
        f"{worst.error:.2g}",
        "-" if worst.error == 0.0 else str(worst.number),
    )
    return f"| {' | '.join(cells)} |", worst
