"""How far noise turns a phase: by more than the tangent says where the light drowns."""

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import NOISE_BAND

__all__ = ["phase_reach"]

Array = NDArray[np.float64]

_SMALL = 0.05  # below it the angle and its sine differ by less than a percent at the band's end


def phase_reach(phase: Array, sd: Array, turn: float) -> Array:
    """Return standard deviations of phases that hold to the ends of the noise band.

    Noise of m standard deviations turns a phasor of length a by at most arcsin(m sd / a), and any
    way where it is as long as the phasor: the phase may then be any of the turn
    (docs/model.md, reach).

    Parameters
    ----------
    phase : ndarray, shape (n,)
        In [0, turn] [rad].
    sd : ndarray, shape (n,)
        Of first order: noise across the phasor over its length [rad].
    turn : float
        Phases are known modulo this: 2 pi, or pi where the sign of the phasor is open [rad].

    Returns
    -------
    ndarray, shape (n,)
        [rad]; nan stays nan.
    """
    most = NOISE_BAND * sd
    angle = np.where(most > 1.0, np.maximum(phase, turn - phase), np.arcsin(np.minimum(most, 1.0)))
    return np.where(sd > _SMALL, angle / NOISE_BAND, sd)
