"""How far noise turns a phase: by more than the tangent says where the light drowns."""

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import NOISE_BAND
from inference.realtime.net import Net

__all__ = ["phase_reach"]

Array = NDArray[np.float64]

_SMALL = 0.05  # below it the angle and its sine differ by less than a percent at the band's end


def phase_reach(phase: Array, sd: Array, net: Net, length: Array, turn: float) -> Array:
    """Return standard deviations of phases that hold to the ends of the noise band.

    Noise of m standard deviations puts the end of a phasor into an ellipse, and turns the phasor as
    far as the tangents from zero to that; any way where noise along it is as long as the phasor:
    the phase may then be any of the turn (docs/model.md, reach).

    Parameters
    ----------
    phase : ndarray, shape (n,)
        In [0, turn] [rad].
    sd : ndarray, shape (n,)
        Of first order: noise across the phasor over its length [rad].
    net : Net
        The phasor, and its noise.
    length : ndarray, shape (n,)
        Of the phasor, in the unit of ``net``.
    turn : float
        Phases are known modulo this: 2 pi, or pi where the sign of the phasor is open [rad].

    Returns
    -------
    ndarray, shape (n,)
        [rad]; nan stays nan.
    """
    # noise of any direction counts, such as of light that is taken off
    bent = np.flatnonzero(np.sqrt(np.maximum(net.var1, net.var2)) > _SMALL * length)
    if bent.size == 0:
        return sd
    few, size, most = net.select(bent), length[bent], NOISE_BAND * sd[bent]
    cosine, sine = few.first / size / size, few.second / size / size
    with np.errstate(all="ignore"):
        along = NOISE_BAND**2 * few.variance(cosine, sine)
        # of noise across with noise along
        turned = cosine * (few.var2 - few.var1) * sine + (cosine - sine) * (cosine + sine) * few.cov
        both = NOISE_BAND**2 * turned
        left = 1.0 - along
        tangent = (np.abs(both) + np.sqrt(np.square(both) + left * np.square(most))) / left
        # not less than of noise that is as large along the phasor as across
        angle = np.maximum(np.arctan(tangent), np.arcsin(np.minimum(most, 1.0)))
        any_way = np.maximum(phase[bent], turn - phase[bent])
        angle = np.where((most > 1.0) | ~(left > 0.0), any_way, angle)
    result = sd.copy()
    result[bent] = np.where(np.isnan(most), np.nan, angle / NOISE_BAND)
    return result
