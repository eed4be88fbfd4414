"""Tables of random sets, read: shares held, and what is far off without a flag."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.random_sets.answers import WAYS
from benchmarks.resumable import rows_of

__all__ = ["FAR", "TABLES", "report", "summary", "table_of", "wrong"]

TABLES = Path(__file__).with_name("results")
FAR = 5.0  # standard deviations
_WIDE = "wide-"  # before the names of tables of wide sets
Rows = Sequence[dict[str, str]]

HEAD = (
    "| way | sets | that answer | ranges told | held | parameters identified | held "
    f"| sets beyond {FAR:g} sd |\n|---|---|---|---|---|---|---|---|"
)


def table_of(way: str, seed: int, *, wide: bool = False) -> Path:
    """Return where the rows of a way and a seed are."""
    return TABLES / f"{_WIDE if wide else ''}{way}-{seed}.csv"


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
    return (
        f"| {way} | {len(rows)} | {answering} | {share(total('answered'), total('asked'))} "
        f"| {share(total('held'), total('answered'))} | {total('parameters')} "
        f"| {share(total('parameters_held'), total('parameters'))} | {len(wrong(rows))} |"
    )


def report(tables: Path) -> str:
    """Return a table over all seeds, and the sets that are far off."""
    lines, far = [HEAD], []
    for way in (*WAYS, *(_WIDE + way for way in WAYS)):
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
