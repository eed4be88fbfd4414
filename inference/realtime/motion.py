"""What motion tells of an object: the power law b of Phi ~ r^b and zeta = 1 + 1/b.

b = (Phi'/Phi) / (r'/r) with derivatives in time (4.49). For a pulse r ~ w1 / w2, so that
zeta = (w1'/w1) / (w2'/w2) (4.56) is the same statement; for a sine wave the logarithmic derivative
x'/x = Phi'/Phi + j k r' holds both rates, without the small-angle approximation of 4.57.
"""

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from simulator.compiled import compiled
from simulator.object_model import log_slope
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["law_of_model", "law_of_motion"]

Array = NDArray[np.float64]


def law_of_motion(sensor: Sensor, net: Net, rate: Net) -> tuple[Array, Array]:
    """Return power law and zeta from readings and their derivatives.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    net : Net
        Readings of an object alone: known crosstalk subtracted, no background.
    rate : Net
        Their derivatives in time.

    Returns
    -------
    power_law, zeta : ndarray, shape (n,)
        nan where the readings or their derivatives do not tell.
    """
    with np.errstate(all="ignore"):
        if isinstance(sensor, PulsedSensor):
            first, second = rate.first / net.first, rate.second / net.second
            zeta = first / second
            power = second / (first - second)
            good = (net.first > 0) & (net.second > 0)
        else:
            modulus = np.hypot(net.first, net.second)
            x, y = net.first / modulus, net.second / modulus
            amplitude = (rate.first * x + rate.second * y) / modulus
            turn = (rate.second * x - rate.first * y) / modulus
            phase = np.mod(np.arctan2(y, x) - sensor.phase_offset_rad, 2 * np.pi)
            power = amplitude * phase / turn
            zeta = 1 + turn / (amplitude * phase)
            good = phase > 0
        good &= (net.state == 0) & (rate.state == 0)
        power = np.where(good & np.isfinite(power), power, np.nan)
        zeta = np.where(good & np.isfinite(zeta), zeta, np.nan)
    return power, zeta


@compiled
def _log_slopes(range_m: Array, c0: float, c1: float) -> Array:
    out = np.empty(range_m.size)
    for i in range(range_m.size):
        out[i] = log_slope(range_m[i], c0, c1)
    return out


def law_of_model(range_m: Array, c0: float, c1: float) -> tuple[Array, Array]:
    """Return power law b = 1 / (zeta - 1) and zeta of the object parameter model.

    Parameters
    ----------
    range_m : ndarray, shape (n,)
        Ranges [m], nan where unknown.
    c0, c1 : float
        Object parameters [m^2], [m].
    """
    with np.errstate(all="ignore"):
        power = _log_slopes(range_m, c0, c1)
        zeta = 1.0 + 1.0 / power
    power = np.where(np.isfinite(power), power, np.nan)
    return power, np.where(np.isfinite(zeta), zeta, np.nan)
