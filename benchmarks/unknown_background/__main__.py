"""Finish the table, then draw the picture and print the table.

    python -m benchmarks.unknown_background [--case A] [--seconds 60] [--sets 53]

Interrupt it at will: it goes on where it stopped. With `--sets 0` it only draws.
"""

import argparse
import functools
from pathlib import Path

from benchmarks.resumable import code_version, resume, rows_of
from benchmarks.unknown_background.cells import CELLS, COLUMNS, row_of
from benchmarks.unknown_background.figure import draw

TABLE = Path(__file__).with_name("results.csv")
FIGURE = Path(__file__).parents[2] / "docs" / "unknown_background.png"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", choices=("A", "W", "B"), help="default: all")
    parser.add_argument("--seconds", type=float, default=60.0, help="at most, a posterior")
    parser.add_argument("--sets", type=int, default=len(CELLS), help="at most so many posteriors")
    given = parser.parse_args()
    wanted = [n for n, cell in enumerate(CELLS) if given.case in (None, cell.case)]
    # little noise first: normal posteriors cost least
    numbers = sorted(wanted, key=lambda n: (CELLS[n].case == "B", -CELLS[n].snr, n))[: given.sets]
    work = functools.partial(row_of, version=code_version(), seconds=given.seconds)
    resume(TABLE, COLUMNS, numbers, work)
    rows = sorted(rows_of(TABLE), key=lambda row: int(row["set"]))
    draw(rows, FIGURE)
    print("| case | R [m] | ranges [m] | SNR | bound | predicted | posterior | error | converged |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        cells = [
            row["case"],
            row["distance_m"],
            f"{row['from_m']}-{row['to_m']}",
            f"{float(row['snr']):.0e}",
            *(f"{100 * float(row[name]):.2g} %" for name in ("bound", "predicted", "sd")),
            f"{float(row['error']):+.1f} sd",
            "yes" if row["converged"] == "1" else "no",
        ]
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
