"""What motion tells of an object: the power law b of Phi ~ r^b and zeta = 1 + 1/b.

b = (Phi'/Phi) / (r'/r) with derivatives in time (4.49). For a pulse r ~ w1 / w2, so that
zeta = (w1'/w1) / (w2'/w2) (4.56) is the same statement; for a sine wave the logarithmic derivative
x'/x = Phi'/Phi + j k r' holds both rates, without the small-angle approximation of 4.57.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from simulator.compiled import compiled
from simulator.discrepancy import SLOPE_SD
from simulator.object_model import log_slope
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["MotionLaw", "law_of_model", "law_of_motion"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class MotionLaw(NamedTuple):
    """Power law and zeta with their standard deviations, each of shape (n,), nan if unknown."""

    power: Array
    power_sd: Array
    zeta: Array
    zeta_sd: Array


def _law(zeta: Array, zeta_sd: Array, good: Flags) -> MotionLaw:
    """Return zeta and b = 1 / (zeta - 1) where they are good."""
    power = 1.0 / (zeta - 1.0)
    good = good & np.isfinite(power) & np.isfinite(zeta)
    # what is not known to better than itself has no standard deviation of first order
    power_sd = np.abs(power) * (zeta_sd * np.abs(power))
    columns = (power, power_sd, zeta, zeta_sd)
    return MotionLaw(*(np.where(good & np.isfinite(x), x, np.nan) for x in columns))


def law_of_motion(sensor: Sensor, net: Net, rate: Net, error_m: float) -> MotionLaw:
    """Return power law and zeta from readings and their derivatives.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    net : Net
        Readings of an object alone: known crosstalk subtracted, no background.
    rate : Net
        Their derivatives in time, whose covariance holds the bias of their windows. The readings'
        own noise is taken for independent of theirs, and the relative error of the signal cancels.
    error_m : float
        Standard deviation of the smooth error of the effective distance [m].

    Returns
    -------
    MotionLaw
        Of the object as it is: an error of the model's flux is none of it.
    """
    with np.errstate(all="ignore"):
        if isinstance(sensor, PulsedSensor):
            first, second = rate.first / net.first, rate.second / net.second
            zeta = first / second
            # of log(w1' / w2') and of log(w1 / w2)
            variance = rate.variance(1.0 / rate.first, -1.0 / rate.second)
            variance = variance + net.variance(1.0 / net.first, -1.0 / net.second)
            square = variance * zeta * zeta
            range_m = sensor.r0 * net.first / net.second
            good = (net.first > 0) & (net.second > 0)
        else:
            modulus = np.hypot(net.first, net.second)
            x, y = net.first / modulus, net.second / modulus
            amplitude = (rate.first * x + rate.second * y) / modulus
            turn = (rate.second * x - rate.first * y) / modulus
            phase = np.mod(np.arctan2(y, x) - sensor.known_phase_rad, 2 * np.pi)
            zeta = 1 + turn / (amplitude * phase)
            # tan of the angle between derivative and reading, over the phase
            size = rate.first**2 + rate.second**2
            of_rate = rate.variance(-rate.second / size, rate.first / size)
            of_phase = net.variance(-y / modulus, x / modulus)
            steep = (1.0 + (turn / amplitude) ** 2) / phase
            square = of_rate * steep**2 + of_phase * (steep + np.abs(zeta - 1) / phase) ** 2
            range_m = phase / sensor.wave_number
            good = phase > 0
        # zeta - 1 is d log(r + epsilon) / d log r over b: epsilon and its slope change it
        late = np.abs(zeta - 1.0) * error_m * math.sqrt(1.0 + SLOPE_SD**2) / range_m
        good &= (net.state == 0) & (rate.state == 0)
        return _law(zeta, np.sqrt(square + late * late), good)


@compiled
def _log_slopes(range_m: Array, c0: float, c1: float) -> Array:
    out = np.empty(range_m.size)
    for i in range(range_m.size):
        out[i] = log_slope(range_m[i], c0, c1)
    return out


def law_of_model(
    range_m: Array, sd_m: Array, object_shape: tuple[float, float], error_flux: float
) -> MotionLaw:
    """Return power law and zeta of the object parameter model.

    Parameters
    ----------
    range_m, sd_m : ndarray, shape (n,)
        Ranges and their standard deviations [m], nan where unknown.
    object_shape : (float, float)
        Object parameters c0 [m^2], c1 [m].
    error_flux : float
        Standard deviation of the smooth relative error of the flux, whose slope is one of b.

    Returns
    -------
    MotionLaw
        The model's b is 1 / (zeta - 1).
    """
    c0, c1 = object_shape
    with np.errstate(all="ignore"):
        power = _log_slopes(range_m, c0, c1)
        away = _log_slopes(range_m + 1e-6 * range_m, c0, c1)
        change = (away - power) / (1e-6 * range_m)
        power_sd = np.hypot(change * sd_m, error_flux * SLOPE_SD)
        law = _law(1.0 + 1.0 / power, power_sd / power**2, np.isfinite(power))
    return law._replace(power=np.where(np.isfinite(power), power, np.nan))
