"""From a checkpoint to the answer."""

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.after_data import judge_draws
from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.cross_check import cross_check
from inference.posterior.job import Checkpoint, Job
from inference.posterior.parameter_summary import summaries_of_chains, summaries_of_weights
from inference.posterior.posterior import (
    Draws,
    LeftOutTerm,
    ParameterSummary,
    Posterior,
    Runtime,
)
from inference.posterior.predictive_check import predictive_check
from inference.posterior.prior_conflict import prior_conflicts
from inference.posterior.range_summary import range_summary
from inference.posterior.ranges import draw_ranges
from inference.posterior.sample import Sample, sample_of
from inference.posterior.selecting import sampled
from inference.posterior.selection import Selection, selection_summary
from inference.posterior.verdict import Verdict
from simulator.scene import Scene

__all__ = ["summarise"]

Array = NDArray[np.float64]

_RANGE_DRAWS = 1000


def _left_out(scene: Scene, selection: Selection | None) -> tuple[LeftOutTerm, ...]:
    absent = {
        "crosstalk": scene.crosstalk,
        "background": scene.background,
        "discrepancy": scene.discrepancy,
    }
    rows = [
        LeftOutTerm(term, "the scene states none")
        for term, value in absent.items()
        if value is None
    ]
    if selection is not None:
        rows += [
            LeftOutTerm(decision.term, decision.reason)
            for decision in selection.decisions
            if not decision.kept
        ]
    return tuple(rows)


def _parameters(density: CollapsedDensity, sample: Sample) -> dict[str, ParameterSummary]:
    names = density.parameters.names
    if sample.chains is not None:
        natural = density.parameters.natural(sample.flat).reshape(sample.z.shape)
        return summaries_of_chains(names, natural)
    if sample.weighted is not None:
        natural = density.parameters.natural(sample.weighted.z)
        return summaries_of_weights(names, natural, sample.weighted.weights)
    n = len(sample.flat)
    return summaries_of_weights(names, density.parameters.natural(sample.flat), np.full(n, 1 / n))


def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    """Make the answer of a job, finished or not.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    wall_s, cpu_s : float
        What it has cost so far [s].

    Returns
    -------
    Posterior
    """
    stated, selection = job.scene, checkpoint.selection
    job = sampled(job, checkpoint)
    density = job.density()
    parameters = density.parameters
    rng = job.stream(4)
    sample = sample_of(density, job, checkpoint, rng)
    z = sample.flat
    verdict, k_hat = checkpoint.verdict, None
    if sample.weighted is not None:
        k_hat = sample.weighted.k_hat
    elif sample.chains is not None:
        verdict, k_hat = cross_check(verdict, job, checkpoint, sample.chains)
    chosen = z[np.linspace(0, len(z) - 1, min(_RANGE_DRAWS, len(z))).astype(int)]
    drawn = draw_ranges(density, chosen, rng)
    conflicts = prior_conflicts(density, z, drawn)
    verdict = Verdict(verdict.converged and not conflicts, (*verdict.reasons, *conflicts))
    fit = predictive_check(density, chosen, drawn, rng)
    ranges = np.full((len(chosen), len(job.frames)), np.nan)
    ranges[:, job.usable] = np.exp(drawn)
    draws = parameters.natural(z).reshape(sample.z.shape)
    return Posterior(
        checkpoint.method,
        job.seed,
        verdict,
        _parameters(density, sample),
        range_summary(job, drawn),
        judge_draws(job.sensor, parameters, z, chosen, drawn, density.frames[:, 2]),
        fit,
        _left_out(stated, selection),
        Runtime(wall_s, cpu_s, checkpoint.calls, k_hat),
        Draws(parameters.names, draws, sample.log_density, ranges),
        None if selection is None else selection_summary(stated, selection),
    )
