"""The object's light for many parameter vectors at once, each at a range of its own."""

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, Rows
from simulator.object_arrays import object_fluxes

__all__ = ["light_of_vectors"]

Array = NDArray[np.float64]


def light_of_vectors(rows: Rows, r: Array, gain: float, instrument: Instrument) -> Array:
    """Return the object's mean readings, crosstalk not included.

    Parameters
    ----------
    rows : Rows
        Of n vectors.
    r : ndarray, shape (n,)
        Their ranges [m].
    gain : float
        The frame's factor.

    Returns
    -------
    ndarray, shape (n, 2)
        What `simulator.readings.object_readings` gives [reading units]; not finite where a vector
        is so far out that its light is no number.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        flux = gain * object_fluxes(r, *rows.shapes.T)
        if instrument.wave is not None:
            phase = instrument.wave[0] * r
            phase += instrument.wave[1] if rows.lags is None else rows.lags
            return np.stack([flux * np.cos(phase), flux * np.sin(phase)], axis=1)
        r0, length = instrument.r0 if isinstance(instrument.r0, tuple) else (instrument.r0, 0.0)
        late = r + (length if rows.lags is None else rows.lags)
        return np.stack([flux * np.clip(late / r0, 0.0, 1.0), flux], axis=1)
