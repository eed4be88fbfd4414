"""Tables of random sets, read: shares held, and what is far off without a flag."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.random_sets.answers import SETS, WAYS
from benchmarks.resumable import rows_of

__all__ = ["FAR", "TABLES", "report", "summary", "table_of", "wrong"]

TABLES = Path(__file__).with_name("results")
FAR = 5.0  # standard deviations
Rows = Sequence[dict[str, str]]

HEAD = (
    "| way | sets | that answer | ranges told | held | parameters identified | held "
    f"| sets beyond {FAR:g} sd | that say misfit |\n|---|---|---|---|---|---|---|---|---|"
)


def _named(way: str, of: str) -> str:
    return way if of == "random" else f"{of}-{way}"


def table_of(way: str, seed: int, *, of: str = "random") -> Path:
    """Return where the rows of a way and a seed are; ``of`` is which sets."""
    return TABLES / f"{_named(way, of)}-{seed}.csv"


def wrong(rows: Rows) -> list[dict[str, str]]:
    """Return the sets of which something is far off without a flag."""
    return [row for row in rows if float(row["worst"]) > FAR]


def summary(way: str, rows: Rows) -> str:
    """Return a line of the table."""

    def total(column: str) -> int:
        return sum(int(row[column]) for row in rows)

    def share(part: int, whole: int) -> str:
        return f"{part / whole:.0%}" if whole else ""

    answering = sum(int(row["answered"]) > 0 for row in rows)
    misfits = sum("misfit" in row["flags"] for row in rows)
    return (
        f"| {way} | {len(rows)} | {answering} | {share(total('answered'), total('asked'))} "
        f"| {share(total('held'), total('answered'))} | {total('parameters')} "
        f"| {share(total('parameters_held'), total('parameters'))} | {len(wrong(rows))} "
        f"| {misfits} |"
    )


def report(tables: Path) -> str:
    """Return a table over all seeds, and the sets that are far off."""
    lines, far = [HEAD], []
    for way in (_named(way, of) for of in SETS for way in WAYS):
        rows = []
        for table in sorted(tables.glob(f"{way}-*.csv")):
            of_seed = rows_of(table)
            rows += of_seed
            far += [(table.stem, row) for row in wrong(of_seed)]
        if rows:
            lines.append(summary(way, rows))
    lines += [
        f"{stem}, set {row['set']} ({row['scene']}): {row['of']} off by {float(row['worst']):.1f}"
        for stem, row in far
    ]
    return "\n".join(lines)
