"""Statuses that are foreseen, beside those that posteriors of random sets have.

    python -m benchmarks.foreseen [--sets 60] [--seed 991] [--max-seconds 15]

Random sets of `benchmarks.random_sets` whose scenes leave something unknown, and whose posteriors
converge without a misfit. What is foreseen knows their ranges, and of the unknowns the priors.
"""

import argparse
import time
from collections import Counter

import numpy as np

from benchmarks.coverage.path_rows import posterior_of
from benchmarks.coverage.paths import PathSet
from benchmarks.random_sets.sets import random_set
from inference.identifiability.before_data import identifiability
from inference.identifiability.status import STATUSES
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.parameters import parameters_of
from simulator.scene import parse_scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=60)
    parser.add_argument("--seed", type=int, default=991)
    parser.add_argument("--max-seconds", type=float, default=15.0, help="of processor time, each")
    given = parser.parse_args()
    counts: dict[str, Counter[tuple[str, str]]] = {"priors": Counter(), "medians": Counter()}
    seconds = dict.fromkeys(counts, 0.0)
    done, number = 0, 0
    while done < given.sets:
        data = random_set(given.seed, number)
        number += 1
        found = posterior_statuses(data, number, given.max_seconds)
        if found:
            done += 1
            for way in counts:
                start = time.process_time()
                foreseen = foresee(data, way == "medians")
                seconds[way] += time.process_time() - start
                counts[way].update((foreseen[name], status) for name, status in found.items())
    print(f"{done} of {number} sets\n")
    print(
        "| foreseen by | rows | alike | better than it is | worse | `identified` | of these right "
        "| s a set |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for way, of in counts.items():
        rank = STATUSES.index
        alike = sum(n for (a, b), n in of.items() if a == b)
        better = sum(n for (a, b), n in of.items() if rank(a) < rank(b))
        sure = sum(n for (a, _), n in of.items() if a == STATUSES[0])
        right = of[STATUSES[0], STATUSES[0]]
        rows = of.total()
        print(
            f"| {way} | {rows} | {alike} | {better} | {rows - alike - better} | {sure} | {right} "
            f"| {seconds[way] / done:.3f} |"
        )


def posterior_statuses(data: PathSet, seed: int, seconds: float) -> dict[str, str]:
    """Return the statuses by a posterior; none where it has no verdict to hold them to."""
    if not parameters_of(data.sensor, parse_scene(data.scene)).names:
        return {}
    settings = {"method": "auto", "seed": seed, "max_seconds": seconds}
    try:
        found = posterior_of(data, SamplerSettings.model_validate(settings))
    except RefusedError:
        return {}
    if not (found.drawn and found.verdict.converged) or found.fit.misfit:
        return {}
    return {row.parameter: row.status for row in found.identifiability}


def foresee(data: PathSet, medians: bool) -> dict[str, str]:
    """Return the statuses foreseen over the priors, or at their medians alone."""
    scene = parse_scene(data.scene)
    present = np.isfinite(data.range_m)
    ranges = np.where(present, data.range_m, 1.0).tolist()
    at = None
    if medians:
        parameters = parameters_of(data.sensor, scene)
        values = parameters.natural(np.zeros((1, len(parameters))))[0].tolist()
        at = dict(zip(parameters.names, values, strict=True))
    found = identifiability(data.sensor, scene, ranges, present.tolist(), at)
    return {row.parameter: row.status for row in found.identifiability}


if __name__ == "__main__":
    main()
