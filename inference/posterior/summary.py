"""From where a job stands to its draws and its answer."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.after_data import statuses_of_draws
from inference.identifiability.status import Identifiability
from inference.posterior.answer.draws import Draws, draws_of
from inference.posterior.answer.folds import near_fold
from inference.posterior.answer.mode_summary import mode_summary
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
from inference.posterior.criticism.predictive_check import predictive_check
from inference.posterior.criticism.prior_conflict import prior_conflicts
from inference.posterior.criticism.prior_sensitivity import mark_sensitive, prior_sensitivity
from inference.posterior.job import Job
from inference.posterior.sample import Sample, sample_of
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.selection import Selection, selection_summary
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.selecting import sampled
from inference.posterior.stages.stage import Drawing, Selecting, Starting, Walking, Weighted
from inference.posterior.stages.starting import begin
from inference.posterior.streams import Stream
from simulator.scene import Scene

__all__ = ["draw", "summarise"]

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
    """Judge every unknown by its draws, and by what it owes to the prior of the ranges."""
    rows = statuses_of_draws(
        job.sensor,
        density.parameters,
        z,
        chosen,
        log_r,
        density.frames[:, 2],
        discrepancy=job.scene.discrepancy,
        common_range=job.scene.motion == "static",
    )
    return mark_sensitive(density.parameters.names, rows, prior_sensitivity(density, chosen, log_r))


def _unknown_yet(names: tuple[str, ...]) -> tuple[Identifiability, ...]:
    """Return what can be said where nothing was drawn: starting points say nothing."""
    reason = "not known yet: nothing was drawn from the posterior, give it more time"
    return tuple(
        Identifiability(name, "not_identified", math.nan, reason) for name in (*names, "range_m")
    )


@dataclasses.dataclass(frozen=True, eq=False)
class _Drawn:
    """What a job has drawn, and the stream that the rest of its answer goes on with."""

    job: Job
    density: CollapsedDensity
    stage: Drawing
    calls: int
    sample: Sample
    draws: Draws
    rng: np.random.Generator


def _drawn(job: Job, checkpoint: Checkpoint) -> _Drawn:
    """Draw what the answer of a job is made of: the one place where its stream is begun."""
    job, stage, calls = sampled(job, checkpoint), checkpoint.stage, checkpoint.calls
    if isinstance(stage, Selecting | Starting):  # there was no time for more
        stage, used = begin(job)
        calls += used
    density, rng = job.density(), job.stream(Stream.ANSWER)
    sample = sample_of(density, stage, rng)
    return _Drawn(job, density, stage, calls, sample, draws_of(density, job, sample, rng), rng)


def draw(job: Job, checkpoint: Checkpoint) -> tuple[Job, Draws]:
    """Return the draws behind the answer of a job, the same as `summarise` makes it from.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.

    Returns
    -------
    (Job, Draws)
        The job with the terms that were kept, and its draws.
    """
    drawn = _drawn(job, checkpoint)
    return drawn.job, drawn.draws


def _out_of_time(job: Job, checkpoint: Checkpoint, wall_s: float) -> tuple[str, ...]:
    limit = job.settings.max_seconds
    if wall_s < limit or checkpoint.stage.progress(job.settings.target_ess).finished:
        return ()
    return (f"stopped at the time limit of {limit:g} s",)


def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    """Make the answer of a job, finished or not.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands; where it was stopped before its optional terms were decided,
        all of them are kept.
    wall_s, cpu_s : float
        What it has cost so far [s]; the wall time as it was given to `tasks`.

    Returns
    -------
    Posterior
    """
    drawn = _drawn(job, checkpoint)
    stage, density, sample, draws = drawn.stage, drawn.density, drawn.sample, drawn.draws
    parameters = density.parameters
    reasons, k_hat = stage.verdict.reasons, None
    if isinstance(stage, Weighted):
        k_hat = stage.draws.k_hat
    elif isinstance(stage, Walking) and sample.chains is not None:
        rng = job.stream(Stream.CROSS_CHECK)
        found, k_hat = cross_check(density, sample.chains, stage.proposal, rng)
        reasons = (*reasons, *found)
    thinned = sample.z[:, :, draws.thinned]
    chosen = thinned.reshape(math.prod(thinned.shape[:3]), len(parameters))
    usable = job.usable
    log_r = np.log(draws.range_m[..., usable]).reshape(len(chosen), int(usable.sum()))
    if sample.drawn:
        reasons = (*reasons, *prior_conflicts(density, sample.flat, log_r))
        fit = predictive_check(drawn.job, density, chosen, drawn.rng)
        judged = _judged(drawn.job, density, sample.flat, chosen, log_r)
        if isinstance(density, DiscrepantDensity):
            larger = larger_discrepancy(density, chosen, log_r)
            fit, judged = judge_fit(fit, larger), judge_scale(judged, larger)
    else:
        fit, judged = _UNCHECKED, _unknown_yet(parameters.names)
    reasons = (*_out_of_time(job, checkpoint, wall_s), *reasons)
    folds = near_fold(drawn.job, density, chosen, log_r)
    return Posterior(
        Checkpoint(stage, drawn.calls).method,
        job.seed,
        Verdict(not reasons, reasons),
        _parameters(density, sample),
        mode_summary(density, stage, sample),
        range_summary(draws, folds, None if sample.weighted is None else sample.weighted.ess),
        judged,
        fit,
        _left_out(job.scene, checkpoint.selection),
        Runtime(wall_s, cpu_s, drawn.calls, k_hat),
        draws,
        selection_summary(job.scene, checkpoint.selection),
    )
