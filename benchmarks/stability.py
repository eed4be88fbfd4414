"""Numbers of roots and their errors over 24 decades, against exact arithmetic: docs/stability.md.

    python -m benchmarks.stability --scenes 1200 --seed 1     (`make stress`)
    python -m benchmarks.stability --only "background_intensity, sine wave"

Sine waves are held to ball arithmetic. Prints a row a technique: frames, roots, frames that lie at
a fold to within the rounding of their readings, wrong counts, and the worst root in units of its
condition times rounding. Then derivatives of mean readings and log densities, held to power series
of balls, in the same units. The exit code is 1 where a count is wrong or something is off by more
than a thousand.
"""

import argparse
import sys
from typing import Any

import numpy as np

from tests.extreme.certified import FAMILIES, tally
from tests.extreme.slopes import worst_slopes
from tests.extreme.tally import Tally
from tests.extreme.waves import WAVES, tally_waves

_BAR = 1e3
_DERIVATIVES = "derivatives"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1200, help="scenes a technique")
    parser.add_argument("--frames", type=int, default=16, help="random ranges a scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slopes", type=int, default=5_000, help="frames of the derivatives")
    rows = [*FAMILIES, *(f"{technique}, sine wave" for technique in WAVES), _DERIVATIVES]
    parser.add_argument("--only", nargs="+", choices=rows, default=rows, metavar="ROW")
    options = parser.parse_args()
    failed = False
    print("| technique | frames | roots | at a fold | wrong counts | worst root |")
    print("|---|---|---|---|---|---|")
    for number, technique in enumerate(FAMILIES):
        if technique not in options.only:
            continue
        rng = np.random.default_rng([options.seed, number])
        # chains of degree 8 take twenty times as long
        scenes = options.scenes // (20 if "cancelling_differential" in technique else 1)
        failed |= _row(technique, tally(technique, max(scenes, 1), options.frames, rng))
    for number, technique in enumerate(WAVES):
        if f"{technique}, sine wave" not in options.only:
            continue
        rng = np.random.default_rng([options.seed, 100 + number])
        found = tally_waves(technique, max(options.scenes // 8, 1), options.frames, rng)
        failed |= _row(f"{technique}, sine wave", found)
    if _DERIVATIVES in options.only:
        failed |= _slopes(options.slopes, options.seed)
    sys.exit(1 if failed else 0)


def _slopes(frames: int, seed: int) -> bool:
    """Print the worst error of derivatives; say whether any is off by more than the bar."""
    worst = worst_slopes(frames, np.random.default_rng([seed, 200]))
    print(f"\n| derivative, {frames:,} frames | worst |\n|---|---|")
    for name, (error, where) in sorted(worst.items()):
        print(f"| {name} | {error:.2g} |", flush=True)
        if not error < _BAR:
            print("OFF", name, where, file=sys.stderr)
    return any(not error < _BAR for error, _ in worst.values())


def _row(name: str, t: Tally[Any]) -> bool:
    """Print a row, and what is wrong to standard error; say whether anything is."""
    print(
        f"| {name} | {t.frames:,} | {t.roots:,} | {t.excused:,} | {len(t.wrong)} | {t.worst:.2g} |",
        flush=True,
    )
    for wrong in t.wrong[:5]:
        print("WRONG", wrong, file=sys.stderr)
    if t.worst > _BAR:
        print("OFF", t.where, file=sys.stderr)
    return bool(t.wrong) or t.worst > _BAR


if __name__ == "__main__":
    main()
