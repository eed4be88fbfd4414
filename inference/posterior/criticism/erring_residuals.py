"""Residuals of frames about the point that meets them best with errors of flux and shadow."""

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.response_rows import ResponseRows
from inference.posterior.criticism.best_point import BestPoint
from inference.posterior.criticism.fit_residuals import FitResiduals, followed_part

__all__ = ["erring_residuals"]

Array = NDArray[np.float64]


def erring_residuals(at: BestPoint, replicates: int, rng: np.random.Generator) -> FitResiduals:
    """Compare the frames with replicates that have noise, and errors of flux and shadow.

    All is linear about the best point; frames and replicates alike are fitted by unknowns, ranges
    and errors, from none of these.

    Parameters
    ----------
    at : BestPoint
        The point.
    replicates : int
        How many.
    """
    best, readings = at
    rows = ResponseRows(best)
    assert best.error is not None  # noqa: S101  # it was sought with errors
    along, by_error = rows.along, rows.by_error
    n, m = along.shape
    d, k = best.z.size, best.error.size
    noisy = np.zeros((n, m), dtype=bool)
    noisy[:, :2] = True
    if best.rates is not None:
        noisy[:, 3:] = best.rates > 0
    # the prior of a range is none of the readings
    off = np.where(noisy, rows.residual(readings), 0.0) + by_error @ best.error
    errors = rng.standard_normal((replicates, k))
    anew = rng.standard_normal((replicates, n, m)) * noisy
    anew += np.einsum("nmk,sk->snm", by_error, errors)
    before = np.concatenate([off[None], anew])
    sets, every = len(before), np.concatenate([rows.jacobian, by_error], axis=2)
    along = np.where(noisy, along, 0.0)
    square = np.square(along).sum(axis=1)
    inverse = np.divide(1.0, square, out=np.zeros(n), where=square > 0)
    before -= along * (inverse * np.einsum("nm,snm->sn", along, before))[:, :, None]
    every = np.where(noisy[:, :, None], every, 0.0)
    every -= along[:, :, None] * (inverse[:, None] * np.einsum("nm,nmk->nk", along, every))[:, None]
    before = before.reshape(sets, n * m)
    gone, found = followed_part(before, every.reshape(n * m, d + k))
    fitted = (before - gone).reshape(sets, n, m)
    present = np.isfinite(best.log_r)
    order = np.flatnonzero(present)[np.argsort(best.log_r[present])]
    length = np.hypot(along[:, 0], along[:, 1])
    unit = np.divide(along[:, :2], length[:, None], out=np.zeros((n, 2)), where=length[:, None] > 0)
    across = fitted[:, :, 1] * unit[:, 0] - fitted[:, :, 0] * unit[:, 1]
    of_flux = found[:, d : d + best.flux_errors]
    return FitResiduals(
        across[:, order],
        np.square(fitted).sum(axis=2),
        best.log_r[order],
        np.square(of_flux).sum(axis=1),
    )
