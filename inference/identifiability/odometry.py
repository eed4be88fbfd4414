"""An experiment of which something is known beside the readings: a ruler's ranges, odometry."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from simulator.parameters import OFFSET, with_offset

__all__ = ["with_rates"]

_WITHIN = 1.0  # standard deviations; at an end of its prior an offset has no slope, and seems known


def with_rates(experiment: Experiment, rates: NDArray[np.float64]) -> Experiment:
    """Return the experiment with knowledge beside its readings, and the offset that this asks for.

    Parameters
    ----------
    experiment : Experiment
        As it is.
    rates : ndarray, shape (n, 2)
        As of `Experiment`.

    Returns
    -------
    Experiment

    Raises
    ------
    InvalidInputError
        Where displacements leave no room for their offset: `simulator.parameters.with_offset`.
    """
    moved = rates[:, 1] > 0
    if OFFSET in experiment.parameters.names or not moved.any():
        return dataclasses.replace(experiment, rates=rates)
    ranges = np.exp(experiment.log_r[moved])
    parameters = with_offset(experiment.parameters, ranges - ranges.min())
    offset = parameters.unknowns[-1]
    ends = offset.from_normal(np.array([-_WITHIN, _WITHIN]), {})
    z = offset.to_normal(np.clip(ranges[[ranges.argmin()]], *ends), {})
    z = np.append(experiment.z, z)
    return dataclasses.replace(experiment, parameters=parameters, z=z, rates=rates)
