"""Parameter vectors with the frames as they see them: all at once, or one by one.

A sensor that follows its temperature is looked at as it would be at its reference, and what that is
depends on its coefficients and on the crosstalk, which a vector has of its own.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Rows, row_of
from inference.frame.blocks import GAIN, WARM, Data
from inference.frame.warmth import without_warmth
from simulator.at_temperature import readings_at_reference
from simulator.sensor import Sensor
from simulator.terms import Terms

__all__ = ["pieces"]

Array = NDArray[np.float64]

_LEAST_GAIN = 1e-6  # of a coefficient so far out that nothing would be left of it


class _Density(Protocol):
    @property
    def sensor(self) -> Sensor: ...
    @property
    def frames(self) -> Array: ...
    @property
    def data(self) -> Data: ...
    def blocks_of(self, frames: Array) -> Data: ...


def pieces(of: _Density, terms: Terms, rows: Rows) -> Iterator[tuple[slice, Rows, Data]]:
    """Yield parameter vectors with the frames as they see them.

    Parameters
    ----------
    of : CollapsedDensity
        Its frames.
    terms, rows : Terms, Rows
        The same vectors.

    Yields
    ------
    (slice, Rows, Data)
        Which of them, their rows, the frames.
    """
    if terms.drift is None:
        yield slice(None), rows, of.data
        return
    for i in range(len(rows.shapes)):
        yield slice(i, i + 1), row_of(rows, i), of.blocks_of(_at_reference(of, terms, i))


def _at_reference(of: _Density, terms: Terms, i: int) -> Array:
    """Return frames as vector i supposes that they were at the sensor's reference temperature.

    Of shape (n, 3 or 7). Where no frame tells a temperature they are what they were.
    """
    frames, out = of.frames, without_warmth(of.frames)
    if terms.drift is None or frames.shape[1] <= WARM:
        return out
    gain_drift, delay_drift = terms.drift[i].tolist()
    static = np.zeros(2) if terms.crosstalk is None else terms.crosstalk[i]
    warm, out = frames[:, WARM], out.copy()
    out[:, :GAIN] = readings_at_reference(of.sensor, frames[:, :GAIN], warm, delay_drift, static)
    out[:, GAIN] *= np.maximum(1.0 + gain_drift * warm, _LEAST_GAIN)
    return out
