"""Coverage: finish the tables, then write the figure and print the shares.

    python -m benchmarks.coverage [--workers 2] [--term default] [--only crosstalk] [--sets 50]

Interrupt it at will: it goes on where it stopped. With `--sets 0` it only reads the tables.
"""

import argparse
import functools
import itertools
from pathlib import Path

from benchmarks.coverage.classes import CLASSES, TERMS, class_row
from benchmarks.coverage.figure import draw
from benchmarks.coverage.intervals import COLUMNS
from benchmarks.coverage.recorded import CELLS, recorded_row
from benchmarks.coverage.report import SETS, coverage, recorded_report, report
from benchmarks.resumable import code_version, pool, resume, rows_of
from tests.recorded.experiment import PATH

TABLES = Path(__file__).with_name("results")
FIGURE = Path(__file__).parents[2] / "docs" / "coverage.png"


def _table(name: str, term: str) -> Path:
    return TABLES / f"{name}-{term}.csv"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--term", action="append", choices=[*TERMS], help="default: all")
    parser.add_argument("--only", action="append", choices=[*CLASSES, "recorded"])
    parser.add_argument("--sets", type=int, default=SETS, help="data sets a class")
    given = parser.parse_args()
    version = code_version()
    with pool(given.workers) as executor:
        terms = given.term or list(TERMS)
        classes = [each for each in given.only or [*CLASSES, "recorded"] if each in CLASSES]
        for number in range(given.sets):  # the first of every class first, so that any time tells
            for slug, term in itertools.product(classes, terms):
                work = functools.partial(class_row, CLASSES[slug], term, version=version)
                resume(_table(slug, term), COLUMNS, range(number + 1), work, executor)
        if given.sets and PATH.exists() and (not given.only or "recorded" in given.only):
            for term in terms:
                work = functools.partial(recorded_row, term, version=version)
                resume(_table("recorded", term), COLUMNS, range(len(CELLS)), work, executor)
    found = [
        coverage(group.name, term, rows)
        for slug, group in CLASSES.items()
        for term in TERMS
        if (rows := rows_of(_table(slug, term)))
    ]
    if found:
        draw(found, FIGURE)
    print(report(found))
    recorded = [(term, row) for term in TERMS for row in rows_of(_table("recorded", term))]
    print("", recorded_report(recorded), sep="\n")


if __name__ == "__main__":
    main()
