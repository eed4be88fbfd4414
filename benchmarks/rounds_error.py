"""How far means of importance draws in rounds are off, by Pareto k-hat and effective size.

    python -m benchmarks.rounds_error [--sets 2] [--seeds 8]

Data sets of paths before crosstalk and a background (`python -m benchmarks.coverage.path_study
--light both`). Rounds begin at the same small populations with every seed. A run's means are held
to those of all other runs of its set, weighted by their effective sizes, which every unknown has of
its own: `off` is the root mean square over runs and unknowns in units of `sd sqrt(1 / ess + 1 / ess
of the others)`, 1 where an effective size says how far a mean is off; `by one size` the same with
the importance sample size for all unknowns; `farthest` the largest error in standard deviations;
`sd` the root mean square of the error of the logarithm of the standard deviation.
"""

import argparse
import collections
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.paths import PATHS, draw_path
from inference.posterior import fold
from inference.posterior.sampling.importance import weighted_sizes
from inference.posterior.sampling.rounds import in_rounds
from inference.posterior.sampling.rounds_so_far import Wanted
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.setting_out import HALFWAY_DRAWS, TOLERATED
from inference.posterior.stages.stage import Tempering, Walking, Weighted
from simulator.scene import parse_scene

Array = NDArray[np.float64]
_TARGET = 400
EDGES = (-np.inf, 0.4, 0.5, 0.6, 0.7, np.inf)


class Run(NamedTuple):
    """Draws of one seed."""

    k_hat: float
    enough: bool
    ess: float  # importance sample size
    sizes: Array  # of every unknown's mean
    mean: Array
    sd: Array


class Errors(NamedTuple):
    """How far the draws of one seed are off, by all others."""

    k_hat: float
    enough: bool
    off: Array  # standard deviations
    own: Array  # what is stated of each
    one: Array  # what one size for all says
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
        wanted = Wanted(_TARGET, HALFWAY_DRAWS, TOLERATED, 0.0)
        rounds = in_rounds(density, stage.proposal, populations, rng, wanted)
        draws = rounds.draws
        mean = draws.weights @ draws.z
        sd = np.sqrt(draws.weights @ (draws.z - mean) ** 2)
        sizes = [weighted_sizes(column, draws.weights)[0] for column in draws.z.T]
        enough = draws.worth >= _TARGET
        found.append(Run(draws.k_hat, enough, draws.ess, np.array(sizes), mean, sd))
    return found


def errors_of(runs: list[Run]) -> list[Errors]:
    """Return how far runs of one set are off."""
    found = []
    for k, run in enumerate(runs):
        others = [*runs[:k], *runs[k + 1 :]]
        sizes = np.array([each.sizes for each in others])
        mean, sd = (
            np.average([getattr(each, name) for each in others], axis=0, weights=sizes)
            for name in ("mean", "sd")
        )
        off = (run.mean - mean) / sd
        own = off / np.sqrt(1.0 / run.sizes + 1.0 / sizes.sum(axis=0))
        one = off / np.sqrt(1.0 / run.ess + 1.0 / sum(each.ess for each in others))
        found.append(Errors(run.k_hat, run.enough, off, own, one, np.log(run.sd / sd)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=2, help="of every class of paths")
    parser.add_argument("--seeds", type=int, default=8)
    given = parser.parse_args()
    by_class: dict[tuple[Any, ...], list[Errors]] = collections.defaultdict(list)
    for path in PATHS:
        for number in range(given.sets):
            for each in errors_of(runs_of(path, number, given.seeds)):
                edge = int(np.searchsorted(EDGES, each.k_hat))
                by_class[EDGES[edge - 1], EDGES[edge], each.enough].append(each)
    print("| k-hat | enough | runs | off | by one size | farthest [sd] | sd |")
    print("|---|---|---|---|---|---|---|")
    for (low, high, enough), rows in sorted(by_class.items()):
        off, own, one, sd = (
            np.concatenate([getattr(row, name) for row in rows])
            for name in ("off", "own", "one", "sd")
        )
        own_rms, one_rms, sd_rms = (np.sqrt(np.mean(each**2)) for each in (own, one, sd))
        print(
            f"| {low:g} to {high:g} | {'yes' if enough else 'no'} | {len(rows)} | {own_rms:.2f} "
            f"| {one_rms:.2f} | {np.abs(off).max():.2f} | {sd_rms:.3f} |"
        )


if __name__ == "__main__":
    main()
