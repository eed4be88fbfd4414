"""Whether the model can make such readings, and errors of what size they would ask for."""

import math

import numpy as np

from inference.density.collapsed import CollapsedDensity
from inference.frame.known_range import rates_of
from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.answer.whole import Whole
from inference.posterior.criticism.best_point import best_point
from inference.posterior.criticism.discrepancy_check import (
    MISFIT,
    LargerDiscrepancy,
    beside_shadow,
)
from inference.posterior.criticism.predictive_check import (
    FLUX_ERROR,
    MISFIT_P,
    NEIGHBOURS,
    TOTAL,
    WANDER,
    predictive_check,
)
from inference.posterior.job import Job

__all__ = [
    "LARGEST",
    "asked_for",
    "flux_error_asked_for",
    "lasts_from_frame_to_frame",
    "model_check",
    "noise_asked_for",
]

LARGEST = 1.0  # standard deviation of the logarithm of the flux: a factor e
_BY_CHANCE = 0.05  # of a check, where the model is refuted by all of them


def model_check(
    job: Job,
    density: CollapsedDensity,
    whole: Whole,
    rng: np.random.Generator,
    others: tuple[Job, ...],
) -> tuple[Fit, LargerDiscrepancy | None]:
    """Check the model at draws, and where it fails before a background at the best point of all.

    Parameters
    ----------
    whole : Whole
        The draws, moved by errors of the size that the scene allows.
    others : tuple of Job
        The other parts of a job whose frames were dealt out.

    Returns
    -------
    (Fit, LargerDiscrepancy or None)
        The latter where the flux's error was integrated out.
    """
    larger = whole.larger
    fit = predictive_check(job, density, whole.chosen, rng, others)
    demands = larger is not None and larger.bayes_factor > MISFIT
    if others or not (fit.misfit or demands):
        return fit, larger
    log_r, error = np.log(whole.draws.range_m[..., job.usable]), job.model_error
    answered = log_r.reshape(-1, log_r.shape[-1])
    best = best_point(density, whole.chosen, whole.log_r, error, answered)
    if best is None:
        return fit, larger
    if larger is not None:
        larger = beside_shadow(larger, best)
    return predictive_check(job, density, whole.chosen, rng, best=best), larger


def flux_error_asked_for(job: Job, fit: Fit) -> float:
    """Return how many times larger an error of the flux readings ask for than the scene allows.

    Parameters
    ----------
    job : Job
        As it was given: a size of its errors that is stated in numbers stands, and one that is
        integrated out because ranges are known has `inference.posterior.answer.where_known`.
    fit : Fit
        Of its frames.

    Returns
    -------
    float
        1 where the size that is allowed for does, or noise alone is what is larger; at most what
        makes an error of `LARGEST`.
    """
    error, asked = job.scene.allowed_error, _check(fit, FLUX_ERROR)
    if error.integrated or not (error.flux > 0 and fit.p_value < MISFIT_P):
        return 1.0
    if asked.p_value > _BY_CHANCE or not asked.expected > 0:
        return 1.0
    times = math.sqrt(asked.statistic / asked.expected)
    return max(1.0, min(times, LARGEST / error.flux))


def asked_for(
    job: Job, density: CollapsedDensity, fit: Fit, larger: LargerDiscrepancy | None
) -> tuple[float, float]:
    """Return for what readings that refute the model ask.

    Parameters
    ----------
    larger : LargerDiscrepancy or None
        Where the flux's error was integrated out: what one twice as large would change. Where
        ranges are known and ask for it, `inference.posterior.answer.where_known` widens the whole.

    Returns
    -------
    (float, float)
        By what an error of the flux, and the variance of the noise, are larger than the scene
        allows; the latter where no error of the flux is asked for.
    """
    of_flux = flux_error_asked_for(job, fit)
    known = rates_of(density.frames) is not None
    if of_flux > 1 or (known and larger is not None and larger.bayes_factor > MISFIT):
        return of_flux, 1.0
    return 1.0, noise_asked_for(fit)


def noise_asked_for(fit: Fit) -> float:
    """Return by what the variance of the noise readings ask for is larger than the stated one.

    Parameters
    ----------
    fit : Fit
        Of the frames, that no larger error of the flux explains.

    Returns
    -------
    float
        Chi-square over what replicates have (Birge 1932) where it is what refutes the model; 1
        otherwise.
    """
    total = _check(fit, TOTAL)
    if not fit.p_value < MISFIT_P or total.p_value > _BY_CHANCE or not total.expected > 0:
        return 1.0
    return max(1.0, total.statistic / total.expected)


def lasts_from_frame_to_frame(fit: Fit) -> bool:
    """Tell whether residuals are smoother than replicates' by more than chance in one of twenty.

    Parameters
    ----------
    fit : Fit
        Against replicates whose noise explains how large residuals are.
    """
    return any(_check(fit, name).p_value < _BY_CHANCE for name in (NEIGHBOURS, WANDER, FLUX_ERROR))


def _check(fit: Fit, name: str) -> FitCheck:
    return next(check for check in fit.checks if check.name == name)
