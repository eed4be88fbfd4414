"""How often every gate of the verdict alarms on healthy runs, and what it lets pass.

    python -m benchmarks.verdict_gates [--runs 10000] [--sequential 1000] [--real 100] [--seed 1]

1. Surrogate runs (`tests.posterior.sampling.surrogate`) of normal, Student and bimodal laws in
   turn, four ensembles of 8 walkers and 100 autocorrelation times, judged once by all gates, the
   density's included. A rate is shown with its binomial 95 % interval (Clopper and Pearson).
2. Linear models whose truth comes from their prior: the gate of priors that end too early.
3. Surrogate runs judged after every chunk until they pass, as a job is: alarms that never end, and
   whether the means of runs that were stopped by their own verdict are as good as they say.
4. The same with defects: how many of them ever pass, at any of the looks.
5. Real ensembles of emcee on cheap targets, judged likewise, with what the surrogate is made from.
"""

import argparse
import time
from collections.abc import Callable

from benchmarks.verdict_gates.defects import defects
from benchmarks.verdict_gates.healthy import priors, sequential, single_looks
from benchmarks.verdict_gates.real import real

PARTS: dict[str, tuple[Callable[[int, int], None], str]] = {
    "priors": (priors, "runs"),
    "real": (real, "real"),
    "sequential": (sequential, "sequential"),
    "defects": (defects, "defects"),
    "single": (single_looks, "runs"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--sequential", type=int, default=1000)
    parser.add_argument("--defects", type=int, default=100)
    parser.add_argument("--real", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=list(PARTS), help="one part of the five")
    wanted = parser.parse_args()
    begin = time.process_time()
    for name, (part, count) in PARTS.items():
        if wanted.only in (None, name):
            part(getattr(wanted, count), wanted.seed)
    print(f"\n{time.process_time() - begin:.0f} s of processor time")


if __name__ == "__main__":
    main()
