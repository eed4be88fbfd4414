"""From where a job stands to its draws and its answer."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.assumptions import assumptions_of
from inference.density.collapsed import CollapsedDensity
from inference.frame.known_range import rates_of
from inference.frame.warmth import gains_of
from inference.identifiability.after_data import statuses_of_draws
from inference.identifiability.status import Identifiability, weak_at_best
from inference.posterior.answer.draws import Draws, draws_of
from inference.posterior.answer.error_parts import ErrorParts
from inference.posterior.answer.fit import Fit
from inference.posterior.answer.folds import near_fold
from inference.posterior.answer.left_out import left_out
from inference.posterior.answer.mode_summary import mode_summary
from inference.posterior.answer.parameter_summary import summaries_of_chains, summaries_of_weights
from inference.posterior.answer.posterior import (
    ParameterSummary,
    Posterior,
    RangeSummary,
    Runtime,
)
from inference.posterior.answer.range_summary import joined, range_summary
from inference.posterior.answer.whole import Whole, with_model_error
from inference.posterior.criticism.cross_check import cross_check
from inference.posterior.criticism.discrepancy_check import (
    MISFIT,
    LargerDiscrepancy,
    judge_fit,
    with_model_part,
)
from inference.posterior.criticism.many_frames import bias_of_many_frames
from inference.posterior.criticism.model_check import model_check
from inference.posterior.criticism.other_optima import Stated, mark_other_optima
from inference.posterior.criticism.prior_conflict import prior_conflicts
from inference.posterior.criticism.prior_contradiction import contradicted
from inference.posterior.criticism.prior_dark import mark_dark
from inference.posterior.criticism.prior_sensitivity import mark_sensitive
from inference.posterior.criticism.room import Room, room_for, with_room
from inference.posterior.findings import Findings
from inference.posterior.job import Job
from inference.posterior.sample import Sample, sample_of
from inference.posterior.sampling.represent import doubts
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.selection import selection_summary
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.selecting import sampled
from inference.posterior.stages.stage import (
    Drawing,
    Selecting,
    Starting,
    Tempering,
    Walking,
    Weighted,
    optima_of,
)
from inference.posterior.stages.standing import standing
from inference.posterior.stages.stopped import stopped
from inference.posterior.streams import Stream
from inference.posterior.undrawn import without_draws
from simulator.one_thread import one_thread

__all__ = ["draw", "summarise"]

Array = NDArray[np.float64]


def _parameters(
    density: CollapsedDensity, sample: Sample, whole: Whole
) -> dict[str, ParameterSummary]:
    names, shares = density.parameters.names, whole.budget.of_z
    if sample.chains is not None:
        natural = density.parameters.natural(sample.flat).reshape(sample.z.shape)
        return summaries_of_chains(names, natural, whole.parameters, shares, sample.chains.start)
    if sample.weighted is not None:
        return summaries_of_weights(names, whole.parameters, sample.weighted.weights, shares)
    return {}  # nothing is unknown


def _judged(drawn: "_Drawn", whole: Whole) -> tuple[Identifiability, ...]:
    """Judge every unknown by its draws, and by what it owes to model and prior of the ranges."""
    job, density = drawn.parts[0], drawn.own
    chosen, log_r, static = whole.chosen, whole.log_r, job.scene.motion == "static"
    rows = statuses_of_draws(
        job.sensor,
        density.parameters,
        whole.spread,
        chosen,
        log_r,
        gains_of(density.frames),
        error=job.model_error,
        common_range=static,
        rates=rates_of(density.frames),
    )
    budget, names = whole.budget, density.parameters.names
    shares = dict(zip(names, budget.of_z.model.tolist(), strict=True))
    missed = dict(zip(names, budget.missed.tolist(), strict=True))
    scale = whole.scale_error, whole.spread.scale
    rows = with_model_part(
        rows,
        *scale,
        budget.curvature,
        shares,
        missed,
        by_flux=budget.by_flux,
        asked_for=job.flux_times > 1,
    )
    rows = mark_sensitive(density.parameters.names, rows, whole.sensitivity)
    if whole.glossy is not None:
        rows = mark_sensitive(density.parameters.names, rows, whole.glossy.open)
    rows = mark_dark(density, rows, chosen, log_r)
    optima = optima_of(drawn.stage)
    if optima is None or drawn.every is not None:  # draws are of other frames then
        return rows
    stated = Stated(
        chosen, drawn.sample.log_density, log_r, whole.spread.parameters, whole.spread.scale
    )
    return mark_other_optima(density, rows, optima.centres, stated)


def _of_all_frames(job: Job, shares: ErrorParts) -> ErrorParts:
    """Return shares of the usable frames as those of all."""
    whole = np.full((3, len(job.frames)), np.nan)
    whole[:, job.usable] = shares.noise, shares.scene, shares.model
    return ErrorParts(*whole)


@dataclasses.dataclass(frozen=True, eq=False)
class _Drawn:
    """What a job has drawn, and how well the model meets the readings there."""

    job: Job
    density: CollapsedDensity
    every: CollapsedDensity | None  # of all frames, where some were sampled in their name
    parts: tuple[Job, ...]
    own: CollapsedDensity  # of the first part, whose draws are kept
    stage: Drawing
    calls: int
    sample: Sample
    draws: Draws
    whole: Whole | None
    checked: tuple[Fit, LargerDiscrepancy | None] | None
    explained: bool  # readings that refute the model, by errors that there is room for
    bias: Array | None


def _drawn(job: Job, checkpoint: Checkpoint, cpu_s: float) -> _Drawn:
    """Draw what the answer of a job is made of: the one place where its stream is begun."""
    given, checkpoint = job, checkpoint.answering
    job, stage, calls = sampled(job, checkpoint), checkpoint.stage, checkpoint.calls
    if isinstance(stage, Selecting | Starting):  # there was no time for more
        begun = stopped(job, stage, cpu_s)
        stage, calls = begun.stage, calls + begun.calls
        job = job.with_error_integrated() if begun.integrated else job
        job = dataclasses.replace(job, representatives=begun.representatives)
    assert not isinstance(stage, Selecting | Starting)  # noqa: S101  # sampling has begun
    stage = standing(stage)
    density, rng = job.density(), job.stream(Stream.ANSWER)
    sample, parts = sample_of(density, stage, rng), job.parts()
    own = density if job.representatives is None else parts[0].density()
    draws, whole = draws_of(own, parts[0], sample, rng, len(parts)), None
    every, bias, checked, explained = None, None, None, True
    if sample.drawn and job.representatives is not None:
        every = dataclasses.replace(job, representatives=None).density()
        bias = bias_of_many_frames(every, sample.flat, job.stream(Stream.PARTS))
    if sample.drawn:

        def moved(part: Job) -> Whole:
            return with_model_error(part, own, sample, draws, density, bias)

        whole = moved(parts[0])
        checked = model_check(parts[0], own, whole, rng, parts[1:])
        stated = Room(parts, whole, not checked[0].misfit)
        room = room_for(given, own, stated, checked, moved, rng)
        parts, whole, explained = room.parts, room.whole, room.explained
        draws = whole.draws
    return _Drawn(
        job,
        density,
        every,
        parts,
        own,
        stage,
        calls,
        sample,
        draws,
        whole,
        checked,
        explained,
        bias,
    )


@one_thread()
def draw(job: Job, checkpoint: Checkpoint) -> tuple[Job, Draws]:
    """Return the draws behind the answer of a job, the same as `summarise` makes it from.

    Also where it makes none because the job's time ended before sampling began.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.

    Returns
    -------
    (Job, Draws)
        The job with the terms that were kept, and its draws; of a job with more frames than are
        judged at once that of a random part of them.
    """
    drawn = _drawn(job, checkpoint, 0.0)
    return drawn.parts[0], drawn.draws


def _out_of_time(job: Job, checkpoint: Checkpoint, cpu_s: float) -> tuple[str, ...]:
    limit = job.settings.max_seconds
    if cpu_s < limit or checkpoint.answering.stage.progress(job.settings.target_ess).finished:
        return ()
    return (f"stopped at the time limit of {limit:g} s",)


def _unfinished(share: float) -> tuple[str, ...]:
    if not share:
        return ()
    return (
        f"{share:.2%} of the integrals over ranges ran out of panels before they settled: the "
        "density is not known well enough there",
    )


@one_thread()
def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    """Make the answer of a job, finished or not.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands; where it was stopped before its optional terms were decided,
        all of them are kept.
    wall_s, cpu_s : float
        What it has cost so far [s]; the processor time as it was given to `tasks`.

    Returns
    -------
    Posterior
    """
    drawn = _drawn(job, checkpoint, cpu_s)
    stage, sample = drawn.stage, drawn.sample
    if drawn.whole is None:
        assert isinstance(stage, Tempering | Walking)  # noqa: S101  # all others have drawn
        found = without_draws(drawn.job, drawn.density, stage)
    else:
        found = _of_draws(drawn, drawn.whole)
    reasons = (*_out_of_time(job, checkpoint, cpu_s), *found.reasons)
    rows = found.identifiability
    if sample.drawn and reasons:
        rows = weak_at_best(rows, "by draws that have not converged")
    return Posterior(
        Checkpoint(stage, drawn.calls).method,
        job.seed,
        sample.drawn,
        Verdict(not reasons, reasons),
        found.parameters,
        mode_summary(drawn.density, stage, sample),
        found.range_m,
        rows,
        found.fit,
        left_out(job, checkpoint.selection),
        Runtime(wall_s, cpu_s, drawn.calls, found.k_hat),
        drawn.draws,
        selection_summary(job.scene, checkpoint.selection),
        assumptions_of(job.scene, job.sensor, job.frames),
    )


def _ranges(drawn: _Drawn, whole: Whole) -> RangeSummary:
    """Summarise the ranges of all frames, part by part."""
    sample, found = drawn.sample, []
    for k, part in enumerate(drawn.parts):
        own = drawn.own
        if k > 0:
            own, rng = part.density(), part.stream(Stream.PARTS, k)
            draws = draws_of(own, part, sample, rng, len(drawn.parts))
            whole = with_model_error(part, own, sample, draws, drawn.density, drawn.bias)
        folds = near_fold(part, own, whole.chosen, whole.log_r)
        shares = _of_all_frames(part, whole.budget.of_log_r)
        start = None if sample.chains is None else sample.chains.start
        found.append(range_summary(whole.draws, folds, sample.resampled, shares, start))
    if len(found) == 1:
        return found[0]
    numbers = [part.of_sent(np.arange(len(part.frames))) for part in drawn.parts]
    return joined(found, numbers, len(drawn.job.frames))


def _of_draws(drawn: _Drawn, whole: Whole) -> Findings:
    """Say what draws say: of every unknown and range, of themselves, and of the model."""
    job, stage, density, sample = drawn.parts[0], drawn.stage, drawn.density, drawn.sample
    log_r = whole.log_r
    reasons, k_hat = stage.verdict.reasons, None
    if isinstance(stage, Weighted):
        k_hat = stage.draws.k_hat
    elif isinstance(stage, Walking) and sample.chains is not None:
        rng = job.stream(Stream.CROSS_CHECK)
        found, k_hat = cross_check(density, sample.chains, stage.proposal, stage.weighted, rng)
        reasons = (*reasons, *found)
    if drawn.every is not None:
        reasons = (*reasons, *doubts(drawn.every, density, sample.flat))
    assert drawn.checked is not None  # noqa: S101  # whatever was drawn was checked
    fit, larger = drawn.checked
    fit = with_room(fit, job)
    judged = _judged(drawn, whole)
    if larger is not None:
        fit = judge_fit(fit, larger)
        if larger.bayes_factor > MISFIT:
            # also one that was widened, as where ranges are known, is no certain answer
            judged = weak_at_best(judged, "by errors of the model that are larger than stated")
    if not drawn.explained:
        judged = weak_at_best(judged, "by readings that no larger noise or smooth error explains")
    found = prior_conflicts(drawn.own, sample.flat, log_r, density, job.model_error)
    fit, judged = contradicted(fit, judged, found)
    reasons = (*reasons, *_unfinished(drawn.draws.unfinished))
    return Findings(
        reasons,
        k_hat,
        _parameters(density, sample, whole),
        _ranges(drawn, whole),
        judged,
        fit,
    )
