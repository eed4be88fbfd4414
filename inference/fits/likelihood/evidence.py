"""How much of what is known of a scene lies about a maximum: what decides between maxima.

The best fit may be a maximum with next to no probability about it: frames in the dark whose ranges
follow their noise tell crosstalk to the noise of a reading, at an object that nothing else speaks
for. What is nearly as good and a thousand times as wide is more probable by as much
(docs/model.md, fit-evidence).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring

__all__ = ["evidence_of"]


def evidence_of(top: Erring, held: int | None = None) -> float:
    """Return twice the log of the evidence of a problem, but for what all sizes of errors share.

    By Laplace's method about its best values: of unknowns and errors with their priors, the ranges
    as they follow (MacKay 1992). What a climb that stopped early would still gain counts too: a
    size that cannot be fitted is not left out. Minus infinity where it cannot be computed.

    Parameters
    ----------
    top : Erring
        The best values.
    held : int, optional
        The unknown that is held where it is. By its value this is twice the log of its marginal
        density (Tierney and Kadane 1986), but for a constant.
    """
    facts, d = top.whole, top.x.size
    k = facts.errors.shape[1]
    rows = np.block([[facts.jacobian, facts.errors], [np.zeros((k, d)), np.eye(k)]])
    # the last rows of the Jacobian are the slopes of the priors' standard normal coordinates
    free = rows if held is None else np.delete(rows, held, axis=1)
    volumes = [_log_volume(part) for part in (free, facts.jacobian[-d:])]
    mode = top.clean.mode
    if mode is not None:  # z of the priors, which its deviance is of, not that of the mode
        volumes[1] += _log_volume(mode.factor)
    evidence = 2.0 * (volumes[1] - volumes[0]) - (top.deviance - top.remaining)
    return evidence if math.isfinite(evidence) else -math.inf


def _log_volume(rows: NDArray[np.float64]) -> float:
    if not np.isfinite(rows).all():
        return math.nan
    with np.errstate(divide="ignore"):
        return float(np.log(np.abs(np.diag(np.linalg.qr(rows, mode="r")))).sum())
