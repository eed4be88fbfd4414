"""Identifiability after data: from draws of a posterior."""

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.erring import erring
from inference.identifiability.expected_posterior import expected_posterior
from inference.identifiability.experiment import Experiment
from inference.identifiability.judged import Spread
from inference.identifiability.reasons import Diagnosis
from inference.identifiability.status import Identifiability
from inference.identifiability.statuses import statuses_of
from simulator.model_error import ModelError
from simulator.parameters import Parameters
from simulator.sensor import Sensor

__all__ = ["statuses_of_draws"]

Array = NDArray[np.float64]

_EXACT = ModelError(0.0, 0.0, integrated=False)
# variance between the frames' mean ranges, in units of that within them; equal ranges read with
# noise give one, and four hundred frames of them never four
_STILL = 4.0


def statuses_of_draws(
    sensor: Sensor,
    parameters: Parameters,
    spread: Spread,
    chosen: Array,
    log_r: Array,
    gain: Array | None = None,
    *,
    error: ModelError = _EXACT,
    common_range: bool = False,
    rates: Array | None = None,
) -> tuple[Identifiability, ...]:
    """Say whether every unknown is identified, by its spread in the posterior, and why.

    Parameters
    ----------
    spread : Spread
        Of all draws, the errors of the model included.
    chosen : ndarray, shape (m, d)
        Draws in the coordinates whose prior is standard normal, to which ``log_r`` belongs.
    log_r : ndarray, shape (m, frames)
        Draws of log r [log m]; nan for a frame without object.
    gain : ndarray, shape (frames,), optional
        Factor of each frame on the sensor's gain.
    error : ModelError, optional
        Sizes of the errors of the model; left out: none.
    common_range : bool
        Whether the object is known not to move.
    rates : ndarray, shape (frames, 2), optional
        As of `Experiment`.

    Returns
    -------
    tuple of Identifiability
        In the order of the unknowns, "range_m" last.

    Notes
    -----
    Reasons are computed at the draw nearest to the mean, with its own ranges: the mean itself may
    lie where no draw is.
    """
    sd = chosen.std(axis=0)
    unit = np.where(sd > 0, sd, 1.0)
    centre = int(np.argmin(np.square((chosen - chosen.mean(axis=0)) / unit).sum(axis=1)))
    present = np.isfinite(log_r[centre])
    here = log_r[centre]
    still = False
    if present.any():
        still = _is_still(log_r[:, present])
        if still:
            here = np.where(present, here[present].mean(), np.nan)
    experiment = Experiment(
        sensor,
        parameters,
        chosen[centre],
        here,
        gain,
        common_range=common_range,
        rates=rates,
    )
    experiment = erring(experiment, error)
    expected = expected_posterior(experiment) if experiment.finite else None
    return statuses_of(Diagnosis(experiment, still), spread, expected)


def _is_still(drawn: Array) -> bool:
    """Return whether the frames' ranges differ by no more than their own uncertainty.

    What all frames share is no motion, and neither is it their own uncertainty: a shift of all
    ranges, and a stretch of the whole way by which they differ.
    """
    n = drawn.shape[1]
    if n < 2:
        return True
    shifted = drawn - drawn.mean(axis=1, keepdims=True)
    way = shifted.mean(axis=0)
    size = float(way @ way)
    if size == 0.0:
        return True
    own, freedom = shifted - way, n - 1
    if n > 2:  # two ranges have no way but their difference
        own, freedom = shifted - (shifted @ way / size)[:, None] * way, n - 2
    within = float(np.square(own).sum(axis=1).mean()) / freedom
    return bool(size / (n - 1) <= _STILL * within)
