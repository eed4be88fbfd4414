"""Numbers of roots and their errors over 24 decades, against exact arithmetic: docs/stability.md.

    python -m benchmarks.stability --scenes 1200 --seed 1     (`make stress`)
    python -m benchmarks.stability --only answers
    python -m benchmarks.stability --only functions

Sine waves are held to ball arithmetic. Prints a row a technique: frames, roots, frames that lie at
a fold to within the rounding of their readings, wrong counts, and the worst root in units of its
condition times rounding. Then derivatives of mean readings and log densities, held to power series
of balls, in the same units. Then tracks, held to the truth and to a dense grid, and joint fits,
held to an optimum in 50 digits, each with the number of its worst case, from which it is drawn
again. Last a row for every public function that computes (`tests/extreme/functions/`), in units of
its condition times rounding, with the date. The exit code is 1 where a count is wrong, something is
off by more than a thousand, or an answer by more than its bar.
"""

import argparse
import datetime
import itertools
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tests.extreme.certified import FAMILIES, tally
from tests.extreme.functions import FUNCTIONS, table_row
from tests.extreme.optima import CASES, SNRS, excess_of, fit_miss
from tests.extreme.slopes import worst_slopes
from tests.extreme.tally import Tally
from tests.extreme.tracks import grid_miss, random_track, verdict_of
from tests.extreme.waves import WAVES, tally_waves

_BAR = 1e3
_DERIVATIVES = "derivatives"
_ANSWERS = "answers"
_FUNCTIONS = "functions"
_TRACK_BAR = 6.0  # standard deviations
_GRID_BAR = 0.25  # of probability: a few Gaussians stand for what the grid keeps all of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=1200, help="scenes a technique")
    parser.add_argument("--frames", type=int, default=16, help="random ranges a scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slopes", type=int, default=5_000, help="frames of the derivatives")
    parser.add_argument("--tracks", type=int, default=2_000, help="streams, a fifth of them faint")
    parser.add_argument("--fits", type=int, default=3, help="data sets a scene, kind and noise")
    rows = [*FAMILIES, *(f"{technique}, sine wave" for technique in WAVES), _DERIVATIVES, _ANSWERS]
    rows.append(_FUNCTIONS)
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
    if _ANSWERS in options.only:
        print("\n| answers | cases | refused | wrong | worst | of | number |")
        print("|---|---|---|---|---|---|---|")
        failed |= _tracks(options.tracks)
        failed |= _faint_tracks(options.tracks // 5)
        failed |= _fits(options.fits)
    if _FUNCTIONS in options.only:
        failed |= _functions()
    sys.exit(1 if failed else 0)


def _functions() -> bool:
    """Print a row a public function; say whether any is off by more than the bar."""
    today = datetime.datetime.now(datetime.UTC).date()
    print(f"\n{today:%d %B %Y}\n")
    print("| function | held to | cases | condition | worst error | case |")
    print("|---|---|---|---|---|---|", flush=True)
    failed = False
    for held in FUNCTIONS:
        row, worst = table_row(held, held.cases)
        print(row, flush=True)
        failed |= worst.decided == 0 or not worst.error <= _BAR
    return failed


def _answers(
    name: str, refused: int, wrong: Sequence[object], found: Mapping[str, float], unit: str
) -> None:
    """Print a row of answers; what is wrong goes to standard error."""
    worst = max(found, key=lambda number: found[number])
    cases = refused + len(found)
    row = (name, f"{cases:,}", refused, len(wrong), f"{found[worst]:.2g}", unit, worst)
    print(f"| {' | '.join(map(str, row))} |", flush=True)
    for each in wrong[:5]:
        print("WRONG", each, file=sys.stderr)


def _tracks(count: int) -> bool:
    """Hold random streams to the truth; say whether any is off or has a hole."""
    refused, wrong, found = 0, [], {}
    for number in range(count):
        verdict = verdict_of(random_track(number))
        if verdict.refused:
            refused += 1
            continue
        # where no frame has one range there is none to be wrong
        found[str(number)] = float(np.nan_to_num(verdict.worst))
        if verdict.wrong or verdict.worst > _TRACK_BAR:
            wrong.append((number, verdict))
    _answers("`track`", refused, wrong, found, "standard deviations")
    return bool(wrong)


def _faint_tracks(count: int) -> bool:
    """Hold faint streams to a dense grid."""
    refused, found = 0, {}
    for number in range(count):
        miss = grid_miss(random_track(number, faint=True))
        if miss is None:
            refused += 1
        else:
            found[str(number)] = miss
    wrong = [pair for pair in found.items() if pair[1] > _GRID_BAR]
    _answers("`track`, faint", refused, wrong, found, "probability, beside a grid")
    return bool(wrong)


def _fits(count: int) -> bool:
    """Hold joint fits to an optimum in 50 digits."""
    refused, wrong, found = 0, [], {}
    for seed in range(1, count + 1):
        for case, kind, snr in itertools.product(CASES, ("pulsed", "sine_wave"), SNRS):
            miss = fit_miss(kind, case, snr, seed=seed)
            name = f"{case}, {kind}, {snr:g}, {seed}"
            if miss.refused:
                refused += 1
                continue
            # a reference that leaves the ranges that are allowed is none
            found[name] = float(np.nan_to_num(excess_of(miss)))
            if found[name] > 1:
                wrong.append((name, miss))
    _answers("`joint_fit`", refused, wrong, found, "1e-3 of chi-square and rounding")
    return bool(wrong)


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
