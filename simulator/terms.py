"""What parameter vectors are in physical units: the values of a scene's terms."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

__all__ = ["Terms"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Terms:
    """Physical values of n parameter vectors; a term that the scene lacks is None.

    Attributes
    ----------
    object : ndarray, shape (n, 3)
        c0 [m^2], c1 [m], c2.
    crosstalk : ndarray, shape (n, 2), optional
        In reading units.
    background : ndarray, shape (n, 4), optional
        Strength [reading units], distance [m], c0' [m^2], c1' [m].
    ranges : ndarray, shape (n, 8)
        Prior density of a range: log p(r) = a0 + a1 log r - ((r - a2) a3)^2 / 2
        - ((log r - a4) a5)^2 / 2 on [a6, a7] [m].
    offset : ndarray, shape (n,), optional
        Range at a displacement of zero [m].
    gain : ndarray, shape (n,), optional
        Of the sensor where it is unknown [reading units m^2].
    lag : ndarray, shape (n,), optional
        Of the sensor where it is unknown (`simulator.sensor_unknowns`): a phase [rad], or of a
        pulse a length [m].
    drift : ndarray, shape (n, 2), optional
        Of the sensor's gain [1/K] and delay [s/K] with its temperature; None of a sensor without
        coefficients.
    """

    object: Array
    crosstalk: Array | None
    background: Array | None
    ranges: Array
    offset: Array | None = None
    gain: Array | None = None
    lag: Array | None = None
    drift: Array | None = None
