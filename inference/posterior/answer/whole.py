"""Draws of the whole: those of the posterior, moved by the errors of its model."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.judged import Spread
from inference.posterior.answer.clock import as_ruled
from inference.posterior.answer.draws import Draws
from inference.posterior.answer.error_budget import ErrorBudget, error_budget
from inference.posterior.criticism.discrepancy_check import LargerDiscrepancy, larger_discrepancy
from inference.posterior.criticism.glossy_object import GlossyObject, glossy_object
from inference.posterior.criticism.many_frames import following
from inference.posterior.criticism.prior_sensitivity import (
    PriorSensitivity,
    leaning,
    prior_sensitivity,
)
from inference.posterior.job import Job
from inference.posterior.sample import Sample
from inference.posterior.streams import Stream

__all__ = ["Whole", "with_model_error"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Whole:
    """What an answer reports.

    Attributes
    ----------
    chosen : ndarray, shape (m, d)
        Draws of the parameters that have ranges, of the posterior.
    log_r : ndarray, shape (m, usable frames)
        Those ranges, of the posterior; nan for a frame without object.
    draws : Draws
        Moved by the errors of the model; log densities and replicated readings are those of the
        posterior.
    parameters : ndarray, shape (..., d)
        Moved draws of the parameters in SI units: of the ensembles, or of importance sampling
        before it was resampled.
    spread : Spread
        Of the moved draws.
    budget : ErrorBudget
        How they were moved.
    larger : LargerDiscrepancy or None
        Where the flux's error was integrated out: what one twice as large would change.
    sensitivity : PriorSensitivity or None
        What the answer owes to the law of the ranges.
    glossy : GlossyObject or None
        Where nothing is said of the object: what changes as it may be glossy.
    """

    chosen: Array
    log_r: Array
    draws: Draws
    parameters: Array
    spread: Spread
    budget: ErrorBudget
    larger: LargerDiscrepancy | None
    sensitivity: PriorSensitivity | None
    glossy: GlossyObject | None

    @property
    def scale_error(self) -> float:
        """Standard deviation of the mean of log r over the frames from the model's errors."""
        present = np.isfinite(self.log_r[0])
        if not present.any():
            return 0.0
        mean = self.budget.by_log_r[:, present, self.budget.model].mean(axis=1)
        return float(np.sqrt(np.square(mean).sum(axis=1).mean()))


def with_model_error(
    job: Job,
    density: CollapsedDensity,
    sample: Sample,
    draws: Draws,
    sampled: CollapsedDensity,
    bias: Array | None,
) -> Whole:
    """Move draws by the errors of the model.

    Parameters
    ----------
    draws : Draws
        The same, with ranges.
    sampled : CollapsedDensity
        That of which they are draws: of all frames, where the job is a part of a larger one.
    bias : ndarray, shape (d,), or None
        By what the parameters are moved because there are many frames.
    """
    rng, d = job.stream(Stream.MODEL_ERROR), sample.z.shape[-1]
    thinned = sample.z[:, :, draws.thinned]
    m, usable = math.prod(thinned.shape[:3]), job.usable
    chosen = thinned.reshape(m, d)
    log_r = np.log(draws.range_m[..., usable]).reshape(m, int(usable.sum()))
    larger = None
    if isinstance(density, DiscrepantDensity):
        stated = density.total(draws.log_likelihood[..., usable].reshape(m, -1))
        larger = larger_discrepancy(density, chosen, log_r, stated)
    sensitivity = prior_sensitivity(sampled, chosen, log_r)
    if bias is not None and leaning(sensitivity) is None:
        sensitivity = following(bias, chosen, log_r)
    owed = leaning(sensitivity)
    glossy = glossy_object(job.scene, density.parameters.names, chosen, log_r)
    budget = error_budget(job, density, chosen, log_r, larger, owed, glossy, rng)
    errors = budget.errors(m, rng)
    z = budget.moved(sample.flat, budget.errors(len(sample.flat), rng)).reshape(sample.z.shape)
    z[:, :, draws.thinned] = budget.moved(chosen, errors).reshape(thinned.shape)
    with np.errstate(divide="ignore"):
        ends = np.log(density.parameters.terms(chosen).ranges[:, 6:8])
    moved = budget.moved_ranges(log_r, errors, ends)
    range_m = draws.range_m.copy()
    ruled = as_ruled(job.frames.select(usable), np.exp(moved), job.model_error.range_m, rng)
    range_m[..., usable] = ruled.reshape(*thinned.shape[:3], -1)
    flat = z.reshape(len(sample.flat), d)
    parameters = density.parameters.natural(flat).reshape(z.shape)
    reported = parameters
    if sample.weighted is not None:
        each = sample.weighted.z
        reported = density.parameters.natural(budget.moved(each, budget.errors(len(each), rng)))
    present = np.isfinite(moved[0])
    scale = float(moved[:, present].mean(axis=1).std()) if present.any() else math.nan
    widened = owed is not None or glossy is not None
    return Whole(
        chosen,
        log_r,
        dataclasses.replace(draws, parameters=parameters, range_m=range_m, widened=widened),
        reported,
        Spread(density.parameters.marginal(flat).std(axis=0), scale),
        budget,
        larger,
        sensitivity,
        glossy,
    )
