"""Which values of a scene are coordinates of a fit, and what the others are."""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.fits.likelihood.coordinates import KNOWN, SAME
from inference.fits.likelihood.unknowns import paths_of
from inference.frame.sensitivity import Value
from simulator.parameters import Parameters
from simulator.sensor import Sensor

__all__ = ["IN_READINGS", "known_and_unknown"]

Array = NDArray[np.float64]

IN_READINGS = (*CROSSTALK, Value.STRENGTH)
_SHADOW = slice(Value.SHADOW_C0, Value.SHADOW_C1 + 1)


def known_and_unknown(
    sensor: Sensor, parameters: Parameters, unit: float
) -> tuple[tuple[str, ...], NDArray[np.int64], Array]:
    """Return names of the coordinates, the coordinate of each value, and the known values."""
    index, known = np.full(SLOTS, KNOWN, dtype=np.int64), np.zeros(SLOTS)
    paths = paths_of(sensor)
    names = tuple(path for path in paths if path in parameters.names)
    for k, path in enumerate(paths):
        if path in names:
            index[k] = names.index(path)
        elif path in parameters.known:
            known[k] = parameters.known[path] / (unit if k in IN_READINGS else 1.0)
    if parameters.shadow_is_object:
        index[_SHADOW] = SAME
    return names, index, known
