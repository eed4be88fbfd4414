"""Integrals of single frames over their range, held to ball arithmetic: docs/stability.md.

    python -m benchmarks.certified_integrals [--cases 1000] [--seed 1]     (in `make stress`)

Cases are ordinary and extreme frames, and frames known to many digits with shot or relative noise,
at the ends of their prior, between a fold's two ranges, and up to 1,000 standard deviations off the
curve (`tests.density.reference.random_case`, `benchmarks.inner_integral.precise_case`). Prints how
many the balls decide, the worst error of the logarithm in nat and in units of its condition times
rounding (`tests.extreme.integrals.condition_of`), and integrals that ran out of panels. The exit
code is 1 where an error is above 1e-6 nat and above a thousand of these units.
"""

import argparse
import math
import sys

import numpy as np

from benchmarks.inner_integral import adaptive, precise_case, unfinished
from tests.density.reference import FEW_TERMS, Case, random_case
from tests.extreme.integrals import certified_log_integral, condition_of

_NAT, _UNITS = 1e-6, 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    print("| frames | decided | worst [nat] | worst in units | wrong | out of panels |")
    print("|---|---|---|---|---|---|", flush=True)
    failed = _row("ordinary and extreme", options.cases // 2, rng, ordinary=True)
    failed |= _row("known to many digits", options.cases - options.cases // 2, rng, ordinary=False)
    sys.exit(1 if failed else 0)


def _row(name: str, count: int, rng: np.random.Generator, *, ordinary: bool) -> bool:
    """Print a row; say whether anything is wrong."""
    decided, lost, nat, units = 0, 0, 0.0, 0.0
    wrong: list[tuple[float, float, Case]] = []
    for _ in range(count):
        case = random_case(rng, FEW_TERMS) if ordinary else precise_case(rng)
        lost += unfinished(case)
        certified = certified_log_integral(case)
        if certified is None:
            continue
        decided += 1
        value = float(certified.mid())
        error = abs(adaptive(case) - value)
        unit = condition_of(case, value) * float(np.finfo(float).eps)
        nat, units = max(nat, error), max(units, error / unit if error > _NAT else 0.0)
        if not (error <= _NAT or error <= _UNITS * unit) or math.isnan(error):
            wrong.append((error, error / unit, case))
    print(
        f"| {name}, {count} | {decided} | {nat:.1e} | {units:.1e} | {len(wrong)} | {lost} |",
        flush=True,
    )
    for found in wrong[:5]:
        print("WRONG", found, file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    main()
