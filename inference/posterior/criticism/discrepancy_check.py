"""What an answer owes to the stated size of the discrepancy: draws weighted to a larger one.

The draws of a posterior are weighted to what they would be had the standard deviation of the flux
error been stated twice as large (the idea of power scaling: Kallioinen et al. 2023). The mean
weight is the Bayes factor of the larger size against the stated one. Under the stated model it
exceeds b with a probability of at most 1/b, whatever the scene (Markov's inequality).
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.status import Identifiability
from inference.posterior.answer.posterior import Fit

__all__ = ["LargerDiscrepancy", "judge_fit", "judge_scale", "larger_discrepancy"]

Array = NDArray[np.float64]

_FACTOR = 2.0
_MISFIT = 1e3  # Bayes factor: a false-alarm rate of at most 1e-3
_MOVED = 1.0  # standard deviations: more than the answer's own uncertainty


@dataclasses.dataclass(frozen=True)
class LargerDiscrepancy:
    """How an answer would change with a discrepancy twice as large.

    Attributes
    ----------
    bayes_factor : float
        Of the larger size against the stated one.
    shift : float
        Change of the mean of log r over frames and draws.
    sd : float
        Standard deviation of the mean of log r over frames, as stated.
    """

    bayes_factor: float
    shift: float
    sd: float


def larger_discrepancy(density: DiscrepantDensity, z: Array, log_r: Array) -> LargerDiscrepancy:
    """Weight draws to a discrepancy twice as large.

    Parameters
    ----------
    density : DiscrepantDensity
        The density as stated.
    z : ndarray, shape (m, d)
        Draws of its posterior.
    log_r : ndarray, shape (m, frames)
        Draws of log r given them; nan for a frame without object.

    Returns
    -------
    LargerDiscrepancy
        Without a shift where no frame holds an object. Where the larger size would put the
        parameters beyond all draws, both figures are too small, never too large.
    """
    larger = dataclasses.replace(density, discrepancy=_FACTOR * density.discrepancy)
    gain = larger.log_likelihood(z) - density.log_likelihood(z)
    gain = np.where(np.isfinite(gain), gain, -np.inf)
    factor = float(np.exp(min(special.logsumexp(gain) - np.log(len(z)), 700.0)))
    present = np.isfinite(log_r[0])
    if not present.any() or not np.isfinite(gain).any():
        return LargerDiscrepancy(factor, 0.0, 0.0)
    scale = log_r[:, present].mean(axis=1)
    moved = float(special.softmax(gain) @ scale - scale.mean())
    return LargerDiscrepancy(factor, moved, float(scale.std()))


def judge_fit(fit: Fit, larger: LargerDiscrepancy) -> Fit:
    """Flag a misfit where the readings demand a larger discrepancy than was stated."""
    if not larger.bayes_factor > _MISFIT:
        return fit
    reason = (
        "a discrepancy twice as large as stated is more than a thousand times as probable: the "
        "object's flux differs from the model by more than its `discrepancy` allows"
    )
    return dataclasses.replace(fit, misfit=True, reasons=(*fit.reasons, reason))


def judge_scale(
    rows: tuple[Identifiability, ...], larger: LargerDiscrepancy
) -> tuple[Identifiability, ...]:
    """Mark the common scale of the ranges as not identified where the stated size decides it.

    Parameters
    ----------
    rows : tuple of Identifiability
        As judged by the spread of the draws.
    larger : LargerDiscrepancy
        From `larger_discrepancy`.

    Returns
    -------
    tuple of Identifiability
        The same rows, but that of ``range_m`` where the larger size moves the scale by more than
        its standard deviation.
    """
    if not abs(larger.shift) > _MOVED * larger.sd:
        return rows
    reason = (
        f"a discrepancy twice as large as stated would move the common scale of the ranges by "
        f"{100 * larger.shift:+.2g} %, more than its own uncertainty of {100 * larger.sd:.2g} %: "
        "it rests on how right the model of the object's flux is taken to be; known crosstalk, "
        "frames without the object or a wider stroke would fix it"
    )
    return tuple(
        dataclasses.replace(row, status="not_identified", reason=reason)
        if row.parameter == "range_m"
        else row
        for row in rows
    )
