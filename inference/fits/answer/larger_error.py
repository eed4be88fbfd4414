"""Whether the frames ask for a larger error of the model than its default (docs/model.md, larger).

The default is the size that errors have of most objects, and known to a factor. Where crosstalk is
unknown, a scene of another size explains the frames nearly as well, and how large the error may be
decides between them: a fit whose best values are improbable says that it is larger.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.problem import FitProblem

__all__ = ["DOUBLINGS", "evidence_of", "is_default", "twice_as_large"]

DOUBLINGS = 2  # of the default, at most
_FACTOR = 2.0


def is_default(problem: FitProblem) -> bool:
    """Return whether the flux's error is that of the default, and no law has it otherwise."""
    return not (problem.law or problem.error.integrated) and problem.error.flux > 0.0


def twice_as_large(problem: FitProblem) -> FitProblem:
    """Return the problem with twice the error of the flux."""
    error = dataclasses.replace(problem.error, flux=_FACTOR * problem.error.flux)
    return dataclasses.replace(problem, error=error)


def evidence_of(top: Erring) -> float:
    """Return twice the log of the evidence of a problem, but for what all sizes of errors share.

    By Laplace's method about its best values: of unknowns and errors with their priors, the ranges
    as they follow (MacKay 1992). What a climb that stopped early would still gain counts too: a
    size that cannot be fitted is not left out. Minus infinity where it cannot be computed.
    """
    facts, d = top.whole, top.x.size
    k = facts.errors.shape[1]
    rows = np.block([[facts.jacobian, facts.errors], [np.zeros((k, d)), np.eye(k)]])
    # the last rows of the Jacobian are the slopes of the priors' standard normal coordinates
    volumes = [_log_volume(part) for part in (rows, facts.jacobian[-d:])]
    evidence = 2.0 * (volumes[1] - volumes[0]) - (top.deviance - top.remaining)
    return evidence if math.isfinite(evidence) else -math.inf


def _log_volume(rows: NDArray[np.float64]) -> float:
    if not np.isfinite(rows).all():
        return math.nan
    with np.errstate(divide="ignore"):
        return float(np.log(np.abs(np.diag(np.linalg.qr(rows, mode="r")))).sum())
