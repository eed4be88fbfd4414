"""What errors of the model that are not integrated out do to readings."""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.frame.warmth import gains_of
from inference.identifiability.experiment import Experiment
from simulator.model_error import ModelError

__all__ = ["errors_left"]

Array = NDArray[np.float64]


def errors_left(
    density: CollapsedDensity, z: Array, log_r: Array, error: ModelError
) -> Array | None:
    """Return whitened derivatives of the readings along errors that a density takes for none.

    Parameters
    ----------
    density : CollapsedDensity
        Of the frames.
    z : ndarray, shape (d,)
        Parameters.
    log_r : ndarray, shape (frames,)
        Ranges; nan for a frame without object.
    error : ModelError
        Sizes of the errors. That of the effective distance moves ranges alone.

    Returns
    -------
    ndarray, shape (frames, 2, k), or None
        Along independent standard normal errors; None where there are none.
    """
    flux = 0.0 if error.integrated else error.flux
    shadow = error.shadow if density.parameters.has_background else 0.0
    if not (flux > 0 or shadow > 0):
        return None
    experiment = Experiment(
        density.sensor,
        density.parameters,
        z,
        log_r,
        gains_of(density.frames),
        discrepancy=flux or None,
        shadow=shadow,
    )
    return experiment.whitened_terms()[2]
