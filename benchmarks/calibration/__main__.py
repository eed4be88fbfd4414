"""Calibrate: finish the tables, then write the figure and print the verdict.

    python -m benchmarks.calibration [--workers 2] [--cell pulsed-object-snr-10 ...]

Interrupt it at will: it goes on where it stopped. With complete tables it only reads them.
"""

import argparse
import functools
import multiprocessing
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path

from benchmarks.calibration.cells import CELLS
from benchmarks.calibration.ranks import columns_of, rank_row
from benchmarks.resumable import code_version, resume

TABLES = Path(__file__).with_name("results")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--cell", action="append", choices=[*CELLS], help="default: every cell")
    parser.add_argument("--sets", type=int, help="at most so many data sets a cell")
    given = parser.parse_args()
    version = code_version()
    with ExitStack() as stack:
        executor: Executor | None = None
        if given.workers > 1:
            context = multiprocessing.get_context("spawn")
            executor = stack.enter_context(ProcessPoolExecutor(given.workers, context))
        for slug in given.cell or CELLS:
            cell = CELLS[slug]
            count = min(cell.sets, given.sets or cell.sets)
            work = functools.partial(rank_row, cell, version=version)
            path = TABLES / f"{slug}.csv"
            done = resume(path, columns_of(cell), range(count), work, executor)
            print(f"{cell.name}: {done} data sets done", flush=True)


if __name__ == "__main__":
    main()
