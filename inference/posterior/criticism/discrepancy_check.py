"""What an answer owes to the stated size of the discrepancy: draws weighted to a larger one.

The draws of a posterior are weighted to what they would be had the standard deviation of the flux
error been stated twice as large (the idea of power scaling: Kallioinen et al. 2023). The mean
weight is the Bayes factor of the larger size against the stated one. Under the stated model it
exceeds b with a probability of at most 1/b, whatever the scene (Markov's inequality).

The larger size reaches further than the draws do, and of plain weights a few in the tail are often
all: answers of one posterior by other seeds were then half as wide again. So weights are flattened
(`inference.posterior.criticism.flattened`).
"""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.expected_posterior import eliminated
from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum
from inference.identifiability.response_rows import ResponseRows
from inference.identifiability.status import Identifiability
from inference.posterior.answer.fit import Fit
from inference.posterior.criticism.best_point import BestPoint
from inference.posterior.criticism.flattened import flattened

__all__ = [
    "ADDED",
    "MISFIT",
    "LargerDiscrepancy",
    "beside_shadow",
    "is_bent",
    "judge_fit",
    "larger_discrepancy",
    "may_be_bent",
    "misses",
    "with_model_part",
]

Array = NDArray[np.float64]

_FACTOR = 2.0
MISFIT = 1e3  # Bayes factor: a false-alarm rate of at most 1e-3
_BENT = 0.3  # share of a linear response that the next order adds, above which it is no guide
ADDED = 0.2  # of the whole uncertainty that the next order adds, above which it is none either
_MOST = 0.5  # of the uncertainty, above which that matters
_MISSED = 1.0  # standard deviations of an unknown that the next order would move it by


@dataclasses.dataclass(frozen=True)
class LargerDiscrepancy:
    """How an answer would change with a discrepancy twice as large.

    Attributes
    ----------
    bayes_factor : float
        Of the larger size against the stated one.
    of_z : ndarray, shape (d,)
        Change of the mean of z.
    of_log_r : ndarray, shape (frames,)
        Change of the mean of log r; zero for a frame without object.
    """

    bayes_factor: float
    of_z: Array
    of_log_r: Array


def larger_discrepancy(
    density: DiscrepantDensity, z: Array, log_r: Array, stated: Array
) -> LargerDiscrepancy:
    """Weight draws to a discrepancy twice as large.

    Parameters
    ----------
    density : DiscrepantDensity
        The density as stated.
    z : ndarray, shape (m, d)
        Draws of its posterior.
    log_r : ndarray, shape (m, frames)
        Draws of log r given them; nan for a frame without object.
    stated : ndarray, shape (m,)
        Log likelihood of z under that density.

    Returns
    -------
    LargerDiscrepancy
        Where the larger size would put the parameters beyond the draws, its figures are too small.
    """
    larger = dataclasses.replace(density, discrepancy=_FACTOR * density.discrepancy)
    each, which = np.unique(z, axis=0, return_inverse=True)  # draws by weight come repeatedly
    gain = larger.log_likelihood(each)[which] - stated
    gain = np.where(np.isfinite(gain), gain, -np.inf)
    factor = float(np.exp(min(scipy.special.logsumexp(gain) - np.log(len(z)), 700.0)))
    if not np.isfinite(gain).any():
        return LargerDiscrepancy(factor, np.zeros(z.shape[1]), np.zeros(log_r.shape[1]))
    by, ranges = flattened(gain), np.where(np.isfinite(log_r), log_r, 0.0)
    return LargerDiscrepancy(factor, by.moved(z), by.moved(ranges))


def beside_shadow(larger: LargerDiscrepancy, at: BestPoint) -> LargerDiscrepancy:
    """Return the same where errors of a shadow may have made what the flux's cannot.

    By Laplace's method about the best points of unknowns, ranges and all errors together, for the
    stated size and for the larger one.
    """
    best, readings = at
    assert best.discrepancy is not None and best.error is not None  # noqa: S101, PT018
    error = best.error.copy()
    error[: best.flux_errors] /= _FACTOR
    wider = dataclasses.replace(best, discrepancy=_FACTOR * best.discrepancy, error=error)
    stated, twice = (_log_mass(each, readings) for each in (best, wider))
    factor = min(larger.bayes_factor, math.exp(min(twice - stated, 700.0)))
    return dataclasses.replace(larger, bayes_factor=factor)


def _log_mass(experiment: Experiment, readings: Array) -> float:
    end, deviance = joint_optimum(experiment, readings)
    rows = ResponseRows(end)
    both = np.concatenate([rows.jacobian, rows.by_error], axis=2)
    across, *_ = eliminated(end, both, rows.along)
    size = both.shape[2]
    whole = np.concatenate([across.reshape(-1, size), np.eye(size)])
    diagonal = np.abs(np.diag(scipy.linalg.qr(whole, mode="r")[0][:size]))
    return float(-0.5 * deviance - np.log(diagonal).sum())


def judge_fit(fit: Fit, larger: LargerDiscrepancy) -> Fit:
    """Flag a misfit where the readings demand a larger discrepancy than was stated."""
    if not larger.bayes_factor > MISFIT:
        return fit
    reason = (
        "a discrepancy twice as large as stated is more than a thousand times as probable: the "
        "object's flux differs from the model by more than its `discrepancy` allows"
    )
    return dataclasses.replace(fit, misfit=True, reasons=(*fit.reasons, reason))


def is_bent(model: float, whole: float, curvature: float) -> bool:
    """Tell whether the response to errors of the model is not linear, and most of what is unknown.

    Parameters
    ----------
    model, whole : float
        Standard deviations of the mean of log r: from the model's errors, and from everything.
    curvature : float
        What the next order would add to the response to them, as a share of it.
    """
    added = curvature * model > ADDED * whole
    return model > _MOST * whole and (curvature > _BENT or added)


def may_be_bent(model: float, whole: float, curvature: float) -> bool:
    """Tell whether `is_bent` has to be asked, of what one step at draws says.

    Parameters
    ----------
    model, whole, curvature : float
        As of `is_bent`, but by one step and a few errors: of 110 random sets the curvature is that
        of repeated steps to a factor of 1.6 in nine of ten, the ratio of the others to 1.3.
    """
    added = curvature * model > 0.5 * ADDED * whole
    return model > 0.6 * _MOST * whole and (curvature > 0.5 * _BENT or added)


def misses(missed: Array) -> bool:
    """Tell whether the response misses an unknown, of which the scale may know nothing.

    Parameters
    ----------
    missed : ndarray, shape (d,)
        By how many standard deviations the next order would move each.
    """
    return bool(np.any(missed > _MISSED))


def with_model_part(
    rows: tuple[Identifiability, ...],
    model: float,
    whole: float,
    curvature: float,
    shares: Mapping[str, float],
    missed: Mapping[str, float],
    *,
    by_flux: bool,
    asked_for: bool = False,
) -> tuple[Identifiability, ...]:
    """Say how much of the common scale's uncertainty is the model's, and whether it is known.

    Parameters
    ----------
    rows : tuple of Identifiability
        As judged by the spread of the whole, the model's part included.
    model, whole : float
        Standard deviations of the mean of log r: from the model's errors, and from everything.
    curvature : float
        What the next order would add to the response to them, as a share of it.
    shares : mapping of str to float
        The model's part of the standard deviation of each unknown.
    missed : mapping of str to float
        By how many of its standard deviations the next order would move it.
    by_flux : bool
        Whether most of it is the flux's, which can be integrated out, not a shadow's.
    asked_for : bool
        Whether it is larger than the scene allows, as the readings ask for.

    Returns
    -------
    tuple of Identifiability
        The same rows, that of ``range_m`` with the figure. Where the response is not linear and
        most of the uncertainty, it is `weak` at best, and so are unknowns of whose uncertainty it
        is most, or that it misses.
    """
    if not model > 0:
        return rows
    text, bent = f"; model error: +-{100 * model:.2g} %", is_bent(model, whole, curvature)
    remedy = (
        "the readings ask for larger errors of the flux than `discrepancy` allows: frames without "
        "the object, or known ranges, do not need it"
        if asked_for
        else "state `discrepancy` as a number, and the error is integrated out in full"
        if by_flux
        else "most of it is the error of the object's shadow on the background, which is not "
        "integrated out: the interval is a guide"
    )
    further = (
        f"by a linear response that the next order changes by {100 * curvature:.0f} % of itself: "
        + remedy
    )
    found = []
    for row in rows:
        scale = row.parameter == "range_m"
        said = row.reason + text if scale else row.reason
        most = bent and (scale or shares.get(row.parameter, 0.0) > _MOST)
        off = missed.get(row.parameter, 0.0) > _MISSED
        if most:
            said += f", {further}" if scale else f"; most of that is the model's error, {further}"
        elif off:
            said += f"; the model's error moves it by more than that, {further}"
        status = "weak" if (most or off) and row.status == "identified" else row.status
        found.append(dataclasses.replace(row, status=status, reason=said))
    return tuple(found)
