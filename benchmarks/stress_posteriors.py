"""Posteriors with one or two unknowns, held to quadrature over all of their prior.

    python -m benchmarks.stress_posteriors --out DIR [--cases 300] [--max-seconds 60]

Pulses and sine waves, 1 to 8 frames, signal-to-noise ratios of 0.1 to 1e7, priors with the truth at
an end. Every finished case is a line of DIR/posteriors.ndjson, and is not done again; the cases are
those of their number. Prints a row of counts and what is wrong; the exit code is 1 where a number
is more than 6 of its Monte Carlo errors off, of an answer that is called converged.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np

from benchmarks.resumable import objects_of
from tests.extreme.posteriors import held, random_case


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--max-seconds", type=float, default=60.0)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "posteriors.ndjson"
    done = {row["case"]: row for row in objects_of(path)}
    with path.open("a") as lines:
        for number in range(options.cases):
            if number in done:
                continue
            case = random_case(number)
            verdict = held(case, max_seconds=options.max_seconds)
            row = {"case": number, "name": case.name, "method": case.method}
            done[number] = row | dataclasses.asdict(verdict)
            lines.write(json.dumps(done[number]) + "\n")
            lines.flush()
    rows = [done[number] for number in range(options.cases)]
    outcomes = sorted({row["outcome"] for row in rows})
    worst = [row["worst"] for row in rows if row["outcome"] in ("held", "wrong")]
    precision = [row["precision"] for row in rows if row["precision"] == row["precision"]]
    print("| posteriors | " + " | ".join(outcomes) + " | worst | precision |")
    print("|---|" + "---|" * len(outcomes) + "---|---|")
    counts = " | ".join(str(sum(row["outcome"] == name for row in rows)) for name in outcomes)
    span = f"{np.min(precision):.2g} to {np.max(precision):.2g}" if precision else ""
    print(f"| {len(rows)} | {counts} | {np.max(worst, initial=0.0):.2g} errors | {span} |")
    wrong = [row for row in rows if row["outcome"] == "wrong"]
    for row in wrong:
        print(row, file=sys.stderr)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
