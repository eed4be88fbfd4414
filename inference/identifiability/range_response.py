"""How a posterior moves with an error of its model, others being unknowns as z is."""

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from inference.identifiability.model_response import FluxTold
from inference.identifiability.response_rows import ResponseRows, flux_step

__all__ = ["range_response", "shadow_response"]

Array = NDArray[np.float64]


def range_response(
    experiment: Experiment, readings: Array, size: float
) -> tuple[Array, Array, FluxTold]:
    """Return the response of a posterior that takes its clock for exact.

    A range that is known beside the readings cannot follow an error of the effective distance: all
    that the readings tell has to. The response is that to an error of the flux
    (`inference.identifiability.model_response`), with the flux's own as further unknowns.

    Parameters
    ----------
    experiment : Experiment
        A draw with its ranges; its ``discrepancy`` is the size of the flux's error, its ``error``
        what that is at the draw.
    readings : ndarray, shape (n, 4)
        Of the frames, and range and displacement [m] where they are known beside them.
    size : float
        Standard deviation of the effective distance's error [m].

    Returns
    -------
    (ndarray, ndarray, FluxTold)
        Change of z and of log r, shape (d, 1 + k) and (n, 1 + k): with what the readings tell of
        the error, and with each of k independent standard normal variates, as far as they leave it
        open; and what they tell, of its coefficients.
    """
    return _response(ResponseRows(experiment, size), readings)


def shadow_response(experiment: Experiment, readings: Array) -> tuple[Array, Array, FluxTold]:
    """Return the response of a posterior that takes shadows for exact, and the flux for erring.

    Parameters
    ----------
    experiment : Experiment
        A draw with its ranges; its ``discrepancy`` is the size of the flux's error, its ``shadow``
        that of the shadow's, its ``error`` both at the draw.
    readings : ndarray, shape (n, 2 or 4)
        As for `range_response`.

    Returns
    -------
    (ndarray, ndarray, FluxTold)
        As of `range_response`.
    """
    return _response(ResponseRows(experiment, followed=experiment.flux_errors), readings)


def _response(rows: ResponseRows, readings: Array) -> tuple[Array, Array, FluxTold]:
    experiment = rows.experiment
    d, known = experiment.z.size, np.zeros(rows.jacobian.shape[2])
    known[:d] = experiment.z
    if experiment.error is not None:
        known[d:] = experiment.error[: known.size - d]
    step = flux_step(rows, rows.residual(readings), -known)
    k = step.across.shape[1]
    spread = np.asarray(scipy.linalg.solve_triangular(step.triangle, np.eye(k)))
    told = FluxTold(step.coefficients(np.zeros(k)), spread)
    of = np.column_stack([told.mean, spread])
    return step.by_error[0][:d] @ of, step.by_error[1] @ of, told
