"""Random sets under what stands by default: what is answered, held, and far off without a flag.

    python -m benchmarks.random_sets [--sets 100] [--way posterior] [--seed S] [--max-seconds 60]
        [--of wide]

Interrupt it at will: it goes on where it stopped, also with more sets. A seed that is left out is a
fresh one; every seed and way has a table of its own. With `--sets 0` it only reads the tables.
"""

import argparse
import functools
import secrets

from benchmarks.random_sets.answers import COLUMNS, SETS, WAYS, answer_row
from benchmarks.random_sets.report import TABLES, report, table_of
from benchmarks.resumable import code_version, resume


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=100, help="of every way")
    parser.add_argument("--way", action="append", choices=[*WAYS], help="left out: all")
    parser.add_argument("--seed", type=int, help="left out: a fresh one")
    parser.add_argument(
        "--max-seconds", type=float, default=60.0, help="of processor time, for one posterior"
    )
    parser.add_argument(
        "--of",
        choices=[*SETS],
        default="random",
        help="wide: sensors and scenes of all kinds; uneven: those, with readings that differ in "
        "noise by up to 100; spoiled: readings as no scene states them; others: of one kind alone, "
        "the last four with a fact that is stated wrongly",
    )
    given = parser.parse_args()
    seed = secrets.randbits(31) if given.seed is None else given.seed
    version = code_version()
    for way in given.way or WAYS:
        work = functools.partial(
            answer_row, way, seed, given.max_seconds, version=version, of=given.of
        )
        if given.sets:
            resume(table_of(way, seed, of=given.of), COLUMNS, range(given.sets), work)
    print(report(TABLES))


if __name__ == "__main__":
    main()
