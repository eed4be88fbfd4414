"""Round trip: forward model -> every technique -> roots, against the mpmath reference.

    python -m benchmarks.realtime_roundtrip --cases 500 --seed 1

Prints, for each technique and sensor, how many cases had how many roots, the worst error in units
of its allowance max(1e-9, 100 eps * condition), and the cases in which the counts differ: excused
where a relative change of the readings by 4 eps changes the reference's own count.
"""

import argparse
import collections
import sys

import numpy as np

from tests.realtime import reference
from tests.realtime.roundtrip import VARIANTS, check


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100, help="cases a technique and sensor")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of a technique's name")
    options = parser.parse_args()
    failed = 0
    print(f"{'technique':36} {'sensor':10} {'roots: cases':32} {'error':>9} {'truth':>9}  excused")
    for number, (technique, pulsed) in enumerate(VARIANTS):
        if options.only not in technique:
            continue
        rng = np.random.default_rng([options.seed, number])
        counts: collections.Counter[int] = collections.Counter()
        error = truth = 0.0
        excused = 0
        for _ in range(options.cases):
            case = reference.random_case(technique, pulsed, rng)
            verdict = check(case)
            counts[verdict.reference_count] += 1
            error, truth = max(error, verdict.error), max(truth, verdict.truth_error)
            wrong = verdict.count != verdict.reference_count
            excused += wrong and verdict.excused
            if not verdict.good:
                failed += 1
                print("FAILED", case, verdict)
        shown = ", ".join(f"{k}: {v}" for k, v in sorted(counts.items()))
        kind = "pulsed" if pulsed else "sine wave"
        print(
            f"{technique:36} {kind:10} {shown:32} {error:9.2g} {truth:9.2g}  {excused}", flush=True
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
