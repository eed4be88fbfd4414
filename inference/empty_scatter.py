"""Frames without the object that scatter by more than the noise that is stated."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.empty_frames import covariance_of_empty
from inference.realtime.net import ABSENT, rule_out
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["scatter_of_empty"]

# of a sensor whose noise is as stated: how often it is doubted
_FALSE_ALARM = 1e-6
_NORMAL = 4.75  # standard deviations, beyond which a normal law has that


def scatter_of_empty(sensor: Sensor, frames: Frames) -> str | None:
    """Return how empty frames scatter about their mean by more than the stated noise.

    Nothing of the scene is asked: whatever stands before the sensor, frames without the object
    read the same but for their noise. The normalised squares about the mean sum to chi-square of
    2 (n - 1) degrees of freedom.

    Parameters
    ----------
    sensor, frames : Sensor, Frames
        The request.

    Returns
    -------
    str or None
        For a person. None where they scatter as noise does (false alarm 1e-6), where there are
        fewer than two, and where gain or temperature change their light.
    """
    if frames.object_present is None:
        return None
    empty = frames.select(np.flatnonzero(rule_out(sensor, frames) == ABSENT))
    n = len(empty.readings)
    if n < 2 or sensor.temperature is not None or np.ptp(empty.gains) > 0.0:
        return None
    mean = empty.readings.mean(axis=0)
    away = empty.readings - mean
    # readings are rounded, however little noise they have
    rounding = np.square(np.finfo(float).eps * mean)
    covariance = covariance_of_empty(sensor, mean) + np.diag(rounding)
    total = float(np.sum(away * np.linalg.solve(covariance, away.T).T))
    if not _beyond_chance(total, 2 * (n - 1)):
        return None
    times = np.sqrt(np.square(away).sum(axis=0) / (n - 1) / np.diag(covariance))
    return _said(sensor, n, times)


def _beyond_chance(total: float, freedom: int) -> bool:
    # chi-square leans to the right: its quantiles lie above the normal law's
    if total <= freedom + _NORMAL * math.sqrt(2.0 * freedom):
        return False
    import scipy  # a third of a second that frames without a doubt need not wait for

    return bool(scipy.special.chdtrc(freedom, total) < _FALSE_ALARM)


def _said(sensor: Sensor, n: int, times: NDArray[np.float64]) -> str:
    shown = " and ".join(
        f"{column} {ratio:.2g} times" for column, ratio in zip(sensor.columns, times, strict=True)
    )
    return (
        f"the {n} empty frames (object_present false) scatter about their mean by more than the "
        f"stated noise: {shown} as far. If that is the noise of all frames, standard deviations "
        "are too small by as much: measure noise.read. Else light or crosstalk has changed "
        "between them, or one of them is not empty"
    )
