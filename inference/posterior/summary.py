"""From a checkpoint to the answer."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.after_data import judge_draws
from inference.identifiability.status import Identifiability
from inference.posterior.answer.draws import draws_of
from inference.posterior.answer.folds import near_fold
from inference.posterior.answer.joint_modes import joint_modes
from inference.posterior.answer.parameter_summary import summaries_of_chains, summaries_of_weights
from inference.posterior.answer.posterior import (
    Fit,
    LeftOutTerm,
    ParameterSummary,
    Posterior,
    Runtime,
)
from inference.posterior.answer.range_summary import range_summary
from inference.posterior.criticism.cross_check import cross_check
from inference.posterior.criticism.discrepancy_check import (
    judge_fit,
    judge_scale,
    larger_discrepancy,
)
from inference.posterior.criticism.law_check import judge_law, law_shift
from inference.posterior.criticism.predictive_check import predictive_check
from inference.posterior.criticism.prior_conflict import prior_conflicts
from inference.posterior.job import Checkpoint, Job
from inference.posterior.sample import Sample, sample_of
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selecting import sampled
from inference.posterior.selection.selection import Selection, selection_summary
from simulator.scene import Scene

__all__ = ["summarise"]

Array = NDArray[np.float64]

_UNCHECKED = Fit(
    math.nan, False, ("not checked: nothing was drawn yet",), math.nan, math.nan, (), ()
)


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
    found = summaries_of_weights(names, density.parameters.natural(sample.flat), np.full(n, 1 / n))
    # starting points are no draws: nothing is known of how well they stand for the posterior
    unknown = math.nan
    return {
        name: dataclasses.replace(row, ess_bulk=unknown, ess_tail=unknown, mcse_mean=unknown)
        for name, row in found.items()
    }


def _judged(
    job: Job, density: CollapsedDensity, z: Array, chosen: Array, log_r: Array
) -> tuple[Identifiability, ...]:
    """Judge every unknown by its draws, and by what it owes to the law of the ranges."""
    rows = judge_draws(
        job.sensor,
        density.parameters,
        z,
        chosen,
        log_r,
        density.frames[:, 2],
        discrepancy=job.scene.discrepancy,
        common_range=job.scene.motion == "static",
    )
    return judge_law(density.parameters.names, rows, law_shift(density, chosen, log_r))


def _unknown_yet(names: tuple[str, ...]) -> tuple[Identifiability, ...]:
    """Return what can be said where nothing was drawn: starting points say nothing."""
    reason = "not known yet: nothing was drawn from the posterior, give it more time"
    return tuple(
        Identifiability(name, "not_identified", math.nan, reason) for name in (*names, "range_m")
    )


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
    draws = draws_of(density, job, sample, rng)
    thinned = sample.z[:, :, draws.thinned]
    chosen = thinned.reshape(math.prod(thinned.shape[:3]), len(parameters))
    log_r = np.log(draws.range_m[..., job.usable]).reshape(len(chosen), int(job.usable.sum()))
    if sample.drawn:
        conflicts = prior_conflicts(density, z, log_r)
        verdict = Verdict(verdict.converged and not conflicts, (*verdict.reasons, *conflicts))
        fit = predictive_check(job, density, chosen, rng)
        judged = _judged(job, density, z, chosen, log_r)
        if isinstance(density, DiscrepantDensity):
            larger = larger_discrepancy(density, chosen, log_r)
            fit, judged = judge_fit(fit, larger), judge_scale(judged, larger)
    else:
        fit, judged = _UNCHECKED, _unknown_yet(parameters.names)
    folds = near_fold(job, density, chosen, log_r)
    importance_ess = None if sample.weighted is None else sample.weighted.ess
    return Posterior(
        checkpoint.method,
        job.seed,
        verdict,
        _parameters(density, sample),
        joint_modes(density, checkpoint.optima, sample),
        range_summary(draws, folds, importance_ess),
        judged,
        fit,
        _left_out(stated, selection),
        Runtime(wall_s, cpu_s, checkpoint.calls, k_hat),
        draws,
        None if selection is None else selection_summary(stated, selection),
    )
