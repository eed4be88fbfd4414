"""This project's sampler, and the reference that a long run of it leads to."""

import dataclasses
import math
import time

import numpy as np
from numpy.typing import NDArray

from benchmarks.samplers.outcome import Outcome, enough, equal, judged
from inference.density.collapsed import CollapsedDensity
from inference.posterior import fold
from inference.posterior.job import Job
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.importance import draw_weighted
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.start import Optimum
from inference.posterior.sampling.transport import fit_map
from inference.posterior.stages.stage import Walking

Array = NDArray[np.float64]


def ours(job: Job, cap: float) -> tuple[Outcome, fold.Checkpoint]:
    begin = time.process_time()
    checkpoint, earlier = fold.start(job), ""
    while time.process_time() - begin < cap:
        tasks = fold.tasks(job, checkpoint)
        if not tasks:
            break
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
        reached = fold.progress(job, checkpoint)
        if not earlier and enough(reached.ess or 0.0, reached.rhat or math.inf):
            earlier = f"ESS and R-hat after {time.process_time() - begin:.1f} s"
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    seconds = time.process_time() - begin
    note = "; ".join(filter(None, [earlier, *posterior.verdict.reasons]))
    stage = checkpoint.stage
    if not isinstance(stage, Walking) or stage.steps < 4:
        empty = np.empty((0, len(job.density().parameters)))
        return Outcome(seconds, False, 0.0, math.inf, empty, np.empty(0), note), checkpoint
    kept = stage.chains(job.density().parameters.names).z
    ess, r_hat = judged(kept, stage.start)
    return Outcome(
        seconds, posterior.verdict.converged, ess, r_hat, *equal(kept), note=note
    ), checkpoint


def reference(
    job: Job, density: CollapsedDensity, optima: list[Optimum], cap: float
) -> tuple[Array, Array, str]:
    """Mean and sd of every z, and what they rest on."""
    long = job.settings.model_copy(update={"target_ess": 2000, "seed": job.seed + 1000})
    outcome, _ = ours(dataclasses.replace(job, settings=long), cap)
    rng = np.random.default_rng(job.seed + 2000)
    pilot = outcome.z[rng.integers(0, len(outcome.z), 20_000)]
    weighted = draw_weighted(
        density,
        Proposal(mixture_of(optima), fit_map(pilot, coordinates_of(density)), 1.0),
        rng,
        30_000,
    )
    if weighted.k_hat < 0.7:
        z, w = weighted.z, weighted.weights
        basis = f"importance sampling, k-hat {weighted.k_hat:.2f}, ESS {weighted.ess:.0f}"
    else:
        z, w = outcome.z, outcome.weights
        basis = f"a run of ours of {outcome.seconds:.0f} s (importance k-hat {weighted.k_hat:.2f})"
    mean = w @ z
    return mean, np.sqrt(w @ (z - mean) ** 2), basis
