"""Mean readings of a frame and their derivatives along everything that may be unknown."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import Pair
from simulator.background import shadow
from simulator.compiled import compiled
from simulator.object_model import quadratic
from simulator.readings import (
    background_readings,
    background_slopes,
    object_readings,
    object_slopes,
)

__all__ = ["SLOTS", "frame_slopes"]

Array = NDArray[np.float64]

# c0, c1, c2, two crosstalks, background's strength and distance, shadow's c0' and c1', log r
SLOTS = 9


@compiled
def frame_slopes(
    out: Array,
    u: float,
    values: Array,
    gain: float,
    background: bool | None,
    r0: float,
    wave: Pair | None,
) -> None:
    """Fill mean readings of a frame and their derivatives.

    Parameters
    ----------
    out : ndarray, shape (SLOTS + 2, 4)
        Rows: derivative along each slot, along log r, and last the value itself. Columns: both
        readings, then the object's part of both.
    u : float
        log r; nan where there is no object.
    values : ndarray, shape (SLOTS,)
        c0 [m^2], c1 [m], c2, crosstalk (2), strength, distance [m], c0' [m^2], c1' [m]; reading
        units. Background members are not read where there is none.
    gain : float
        Sensor's gain times the frame's factor, reading units; ``values`` of the background are
        scaled by the frame's factor alone, see ``values[SLOTS]``.
    background : bool or None
        None where the scene has no background.
    r0, wave
        As for `simulator.readings`.
    """
    out[:] = 0.0
    top = SLOTS + 1
    factor = values[SLOTS]
    r = math.inf
    if math.isfinite(u):
        r = math.exp(u)
        c0, c1, c2 = values[0], values[1], values[2]
        strength = gain * factor * c0 * c2
        o1, o2 = object_readings(r, r0, wave, strength, c0, c1)
        s1, s2 = object_slopes(r, r0, wave, strength, c0, c1)
        q = quadratic(r, c0, c1)
        # d log(c0 / Q) / dc0 without cancellation
        along0, along1, along2 = r * (r + c1) / c0 / q, -r / q, 1.0 / c2
        for column in (0, 2):
            out[0, column], out[0, column + 1] = o1 * along0, o2 * along0
            out[1, column], out[1, column + 1] = o1 * along1, o2 * along1
            out[2, column], out[2, column + 1] = o1 * along2, o2 * along2
            out[SLOTS, column], out[SLOTS, column + 1] = s1, s2
            out[top, column], out[top, column + 1] = o1, o2
    out[3, 0], out[4, 1] = 1.0, 1.0
    out[top, 0] += values[3]
    out[top, 1] += values[4]
    if background is not None:
        distance, d0, d1 = values[6], values[7], values[8]
        bare = (factor, distance, d0, d1)
        b1, b2 = background_readings(r, r0, wave, bare)
        size = values[5]
        out[5, 0], out[5, 1] = b1, b2
        out[top, 0] += size * b1
        out[top, 1] += size * b2
        visible = 1.0
        if math.isfinite(r):
            visible = shadow(r, d0, d1)
            q = quadratic(r, d0, d1)
            unit1, unit2 = background_readings(math.inf, r0, wave, bare)
            along0, along1 = -size * r * (r + d1) / q / q, size * d0 * r / q / q
            out[7, 0], out[7, 1] = along0 * unit1, along0 * unit2
            out[8, 0], out[8, 1] = along1 * unit1, along1 * unit2
            a1, a2 = background_slopes(r, r0, wave, (size * factor, distance, d0, d1))
            out[SLOTS, 0] += a1
            out[SLOTS, 1] += a2
        if wave is not None:
            out[6, 0], out[6, 1] = -wave[0] * size * b2, wave[0] * size * b1
        elif distance < r0:
            out[6, 0] = size * factor * visible / r0
