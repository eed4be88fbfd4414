"""What an error of the effective distance does to what frames tell, without any draw.

The error is smooth along log r. Where nothing is known of ranges beside the readings, every range
follows it, as far as the readings tell the range at all, and no unknown does. A range that is known
cannot follow: readings are then off by it, and a ruler's range is that of the effective distance to
no better than the error (docs/model.md, clock-beside-rulers). Posteriors have the same rule
(`inference.posterior.answer.error_budget`).
"""

import numpy as np
from numpy.typing import NDArray

from inference.frame.delayed import delayed
from simulator.discrepancy import discrepancy_basis
from simulator.sensor import Sensor, instrument

__all__ = ["as_ruled", "by_clock", "drifts", "with_clock"]

Array = NDArray[np.float64]


def by_clock(
    sensor: Sensor, signal: Array, log_r: Array, reach_m: tuple[float, float], size: float
) -> Array:
    """Return derivatives of the readings along the coefficients of the error, shape (n, 2, k).

    Parameters
    ----------
    signal : ndarray, shape (n, 2)
        The object's part of the readings.
    log_r : ndarray, shape (n,)
        nan for a frame without object.
    reach_m : (float, float)
        Ranges [m] that the error is drawn over.
    size : float
        Standard deviation of the error [m].
    """
    basis, present = discrepancy_basis(*reach_m), np.isfinite(log_r)
    at = np.where(present, log_r, basis.first)
    late = delayed(signal, at, *instrument(sensor)) * present[:, None]
    return np.asarray(size * late[:, :, None] * basis.values(at)[:, None])


def drifts(log_r: Array, reach_m: tuple[float, float], size: float, share: Array) -> Array:
    """Return how every log r follows the coefficients of the error alone, shape (n, k).

    Parameters
    ----------
    log_r, reach_m, size
        As of `by_clock`.
    share : ndarray, shape (n,)
        Of the information on log r what is the readings'.
    """
    basis, present = discrepancy_basis(*reach_m), np.isfinite(log_r)
    at = np.where(present, log_r, basis.first)
    scale = np.where(present, size * share * np.exp(-at), 0.0)
    return np.asarray(scale[:, None] * basis.values(at))


def with_clock(rates: Array, size: float) -> Array:
    """Return ``rates`` of an `Experiment`, known ranges being those of the effective distance."""
    widened = rates.copy()
    widened[:, 0] = rates[:, 0] / np.hypot(1.0, size * rates[:, 0])
    return widened


def as_ruled(rates: Array | None, log_r: Array, size: float) -> tuple[Array, Array]:
    """Return what is left of an error of the effective distance in the range that a ruler tells.

    With w the share of the ruler's variance in that of its range of the effective distance, the
    range is known + w (effective - known), with a variance of w size^2
    (`inference.posterior.answer.clock`), of which a smooth error has w^2 size^2 already.

    Parameters
    ----------
    rates : ndarray, shape (n, 2), optional
        As `with_clock` returns.

    Returns
    -------
    (ndarray, ndarray), shape (n,)
        w, 1 where no ruler tells the range, and the further variance of log r.
    """
    share, own = np.ones(log_r.size), np.zeros(log_r.size)
    if rates is None or not size > 0:
        return share, own
    told = (rates[:, 0] > 0) & np.isfinite(log_r)
    share[told] = np.maximum(1.0 - np.square(size * rates[told, 0]), 0.0)
    own[told] = np.square(size * np.exp(-log_r[told])) * share[told] * (1.0 - share[told])
    return share, own
