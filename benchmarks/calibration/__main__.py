"""Calibrate: finish the tables, then write the figure and print the verdict.

    python -m benchmarks.calibration [--workers 2] [--cell pulsed-object-snr-10 ...] [--sets 200]

Interrupt it at will: it goes on where it stopped. With `--sets 0` it only reads the tables.
"""

import argparse
import functools
from pathlib import Path

from benchmarks.calibration.cells import CELLS
from benchmarks.calibration.figure import draw
from benchmarks.calibration.ranks import columns_of, rank_row
from benchmarks.calibration.report import cell_ranks, report
from benchmarks.resumable import code_version, pool, resume, rows_of

TABLES = Path(__file__).with_name("results")
FIGURE = Path(__file__).parents[2] / "docs" / "calibration.png"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--cell", action="append", choices=[*CELLS], help="default: every cell")
    parser.add_argument("--sets", type=int, help="at most so many data sets a cell")
    given = parser.parse_args()
    version = code_version()
    with pool(given.workers) as executor:
        for slug in given.cell or CELLS:
            cell = CELLS[slug]
            count = cell.sets if given.sets is None else min(cell.sets, given.sets)
            work = functools.partial(rank_row, cell, version=version)
            path = TABLES / f"{slug}.csv"
            done = resume(path, columns_of(cell), range(count), work, executor)
            if done:
                print(f"{cell.name}: {done} data sets done", flush=True)
    found = [cell_ranks(cell, rows_of(TABLES / f"{slug}.csv")) for slug, cell in CELLS.items()]
    draw(found, FIGURE)
    print(report(found))


if __name__ == "__main__":
    main()
