"""How far means of importance draws in rounds are off, by Pareto k-hat and effective size.

    python -m benchmarks.rounds_error [--sets 2] [--seeds 8]

Data sets of paths before crosstalk and a background (`python -m benchmarks.coverage.path_study
--light both`). Rounds begin at the same small populations with every seed. A run's means are held
to those of all other runs of its set, weighted by their effective sizes: `off` is the root mean
square over runs and unknowns in units of `sd sqrt(1 / ess + 1 / ess of the others)`, 1 where an
effective size says how far a mean is off; `farthest` the largest of them over the root of the run's
own size, about so many standard deviations; `sd` that of the logarithm of the standard deviation.
"""

import argparse
import collections
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.paths import PATHS, draw_path
from inference.posterior import fold
from inference.posterior.sampling.rounds import in_rounds
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import Tempering, Walking, Weighted
from inference.posterior.stages.tempering import HALFWAY_DRAWS, TOLERATED
from simulator.scene import parse_scene

Array = NDArray[np.float64]
EDGES = (-np.inf, 0.4, 0.5, 0.6, 0.7, np.inf)


class Run(NamedTuple):
    """Draws of one seed."""

    k_hat: float
    ess: float
    mean: Array
    sd: Array


def runs_of(path: str, number: int, seeds: int) -> list[Run]:
    """Return runs of one data set; none where its posterior needs no rounds."""
    data = draw_path(path, "both", "nothing", number)
    settings = SamplerSettings(method="auto", seed=number)
    job = fold.prepare(data.sensor, parse_scene(data.scene), data.frames, settings)
    checkpoint = fold.start(job)
    while not (isinstance(checkpoint.stage, Tempering) and checkpoint.stage.arrived):
        if isinstance(checkpoint.stage, Walking | Weighted):
            return []
        tasks = fold.tasks(job, checkpoint)
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
    stage, density, found = checkpoint.stage, job.density(), []
    populations = tuple(each.z for each in stage.populations if each is not None)
    for seed in range(seeds):
        rng = np.random.default_rng([number, seed])
        rounds = in_rounds(
            density, stage.proposal, populations, rng, 400, HALFWAY_DRAWS, TOLERATED, 0.0
        )
        draws = rounds.draws
        mean = draws.weights @ draws.z
        sd = np.sqrt(draws.weights @ (draws.z - mean) ** 2)
        found.append(Run(draws.k_hat, draws.ess, mean, sd))
    return found


def errors_of(runs: list[Run]) -> list[tuple[float, float, Array, Array]]:
    """Return k-hat, effective size and errors of means and deviations of runs of one set."""
    found = []
    for k, run in enumerate(runs):
        others = [*runs[:k], *runs[k + 1 :]]
        sizes = np.array([each.ess for each in others])
        mean, sd = (
            np.average([getattr(each, name) for each in others], axis=0, weights=sizes)
            for name in ("mean", "sd")
        )
        off = (run.mean - mean) / (sd * np.sqrt(1.0 / run.ess + 1.0 / sizes.sum()))
        found.append((run.k_hat, run.ess, off, np.log(run.sd / sd)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=2, help="of every class of paths")
    parser.add_argument("--seeds", type=int, default=8)
    given = parser.parse_args()
    by_class: dict[tuple[Any, ...], list[tuple[float, float, Array, Array]]]
    by_class = collections.defaultdict(list)
    for path in PATHS:
        for number in range(given.sets):
            for each in errors_of(runs_of(path, number, given.seeds)):
                edge = int(np.searchsorted(EDGES, each[0]))
                by_class[EDGES[edge - 1], EDGES[edge], each[1] >= 400].append(each)
    print("| k-hat | effective size | runs | off | farthest [sd] | sd |")
    print("|---|---|---|---|---|---|")
    for (low, high, enough), rows in sorted(by_class.items()):
        off = np.concatenate([row[2] for row in rows])
        worst = max(float(np.abs(row[2]).max() / np.sqrt(row[1])) for row in rows)
        sd = np.concatenate([row[3] for row in rows])
        print(
            f"| {low:g} to {high:g} | {'400 and more' if enough else 'below 400'} | {len(rows)} "
            f"| {np.sqrt(np.mean(off**2)):.2f} | {worst:.2f} | {np.sqrt(np.mean(sd**2)):.3f} |"
        )


if __name__ == "__main__":
    main()
