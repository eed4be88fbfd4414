"""Coverage over classes of paths, and of random scenes.

    python -m benchmarks.coverage.path_study [--sets 4] [--class "random walk"] [--light both]
        [--told exact] [--max-seconds 60] [--random 0] [--seed S]

Interrupt it at will: it goes on where it stopped. With `--sets 0` it only reads the tables. The
random scenes of a seed have a table of their own; a seed that is left out is a fresh one.
"""

import argparse
import functools
import secrets
from collections.abc import Sequence
from pathlib import Path

from benchmarks.coverage.path_rows import COLUMNS, path_row, random_row
from benchmarks.coverage.paths import LIGHT, PATHS, TOLD
from benchmarks.resumable import code_version, resume, rows_of

TABLES = Path(__file__).with_name("results") / "paths"
FAR = 5.0  # standard deviations
Rows = Sequence[dict[str, str]]


def summary(name: str, rows: Rows) -> str:
    """Return a line of the table: shares over the sets that have converged, and all counts."""
    good = [row for row in rows if row["converged"] == "1"]
    drawn = [row for row in rows if row["inside"]]

    def share(inside: str, of: str, among: Rows) -> str:
        count = sum(int(row[of]) for row in among)
        return f"{sum(int(row[inside]) for row in among) / count:.0%}" if count else ""

    def ranges(among: Rows) -> str:
        return f"{sum(float(row['inside']) for row in among) / len(among):.0%}" if among else ""

    return (
        f"| {name} | {len(rows)} | {len(good)} | {ranges(good)} "
        f"| {share('identified_inside', 'identified', good)} "
        f"| {share('unknowns_inside', 'unknowns', good)} | {ranges(drawn)} "
        f"| {len(wrong(rows))} |"
    )


def wrong(rows: Rows) -> list[dict[str, str]]:
    """Return the sets that are far off in what is converged, without misfit and identified."""
    return [
        row
        for row in rows
        if row["converged"] == "1" and row["misfit"] == "0" and float(row["worst"]) > FAR
    ]


def random_tables(folder: Path) -> list[Path]:
    """Return the tables of random scenes; not those of random walks."""
    return sorted(folder.glob("random-[0-9]*.csv"))


HEAD = (
    "| class | sets | converged | ranges | parameters, identified | parameters, all "
    f"| ranges, unconverged too | beyond {FAR:g} sd |\n|---|---|---|---|---|---|---|---|"
)


def _table(path: str, light: str, told: str) -> Path:
    slug = f"{path} {light}".replace(", ", "-").replace(" ", "-")
    return TABLES / f"{slug}-{told}.csv"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=4, help="data sets a class and light")
    parser.add_argument("--class", dest="paths", action="append", choices=[*PATHS])
    parser.add_argument("--light", action="append", choices=LIGHT)
    parser.add_argument("--told", action="append", choices=[*TOLD])
    parser.add_argument(
        "--max-seconds", type=float, default=60.0, help="of processor time, for one posterior"
    )
    parser.add_argument("--random", type=int, default=0, help="random scenes")
    parser.add_argument("--seed", type=int, help="of the random scenes; left out: a fresh one")
    given = parser.parse_args()
    version = code_version()
    told = given.told or ["exact"]
    lights = given.light or LIGHT[1:]
    for number in range(given.sets):  # the first of every class first, so that any time tells all
        for path in given.paths or PATHS:
            for light in lights:
                for law in told:
                    group = {"path": path, "light": light, "told": law}
                    work = functools.partial(path_row, group, given.max_seconds, version=version)
                    resume(_table(path, light, law), COLUMNS, range(number + 1), work)
    if given.random:
        seed = secrets.randbits(31) if given.seed is None else given.seed
        work = functools.partial(random_row, seed, given.max_seconds, version=version)
        resume(TABLES / f"random-{seed}.csv", COLUMNS, range(given.random), work)
    for law in told:
        print(f"\nTold: {law}\n", HEAD, sep="\n")
        of_law = {
            (path, light): rows_of(_table(path, light, law)) for path in PATHS for light in LIGHT
        }
        for path in PATHS:
            rows = [row for light in LIGHT for row in of_law[path, light]]
            if rows:
                print(summary(path, rows))
        for light in LIGHT:
            rows = [row for path in PATHS for row in of_law[path, light]]
            if rows:
                print(summary(f"before: {light}", rows))
        print(summary("all", [row for rows in of_law.values() for row in rows]))
    for table in random_tables(TABLES):
        rows = rows_of(table)
        print(f"\nRandom scenes of {table.stem}\n", HEAD, summary("random", rows), sep="\n")
        for row in wrong(rows):
            print(f"set {row['set']}, {row['scene']}: {row['of']} off by {float(row['worst']):.1f}")


if __name__ == "__main__":
    main()
