"""What frames of known range say of the model's errors, once the scene has been learnt.

At a known range the readings that a scene foresees can be compared with those that came: what they
differ by is, to first order, an error of the object's flux and one of the effective distance, two
numbers from two readings (docs/model.md, learnt-error).
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.delayed import delayed
from simulator.at_temperature import at_reference, warmth
from simulator.frames import Frames
from simulator.joint import LearntError
from simulator.parameters import Terms
from simulator.sensor import Sensor, instrument
from simulator.sensor_unknowns import sensor_at
from simulator.simulate import mean_readings

__all__ = ["learnt_error"]

Array = NDArray[np.float64]

_SPARE = 4  # frames beyond the unknowns: fewer say next to nothing of a variance
_STEP = 1e-5  # of a range, for slopes
_SURE = 0.95
_SHOWN = float(scipy.special.ndtri(_SURE)) ** 2  # of the deviance: a size is not below zero
_LEAST = 1e-6  # of a variance: next to nothing of it
_APART = 0.25  # between logarithms of squared sizes that are tried: no maximum is as narrow


def learnt_error(sensor: Sensor, terms: Terms, frames: Frames, unknowns: int) -> LearntError | None:
    """Return the sizes of the errors that frames of known range show.

    Parameters
    ----------
    terms : Terms
        The scene as it was learnt; the first parameter vector is used.
    frames : Frames
        Those of the calibration.
    unknowns : int
        How many numbers were fitted to them.

    Returns
    -------
    LearntError or None
        None where too few ranges are known: `unknowns` and four more.
    """
    static = np.zeros(2) if terms.crosstalk is None else terms.crosstalk[0]
    warm = warmth(sensor, frames)
    if warm is not None:
        frames = at_reference(sensor_at(sensor, terms), frames.select(np.isfinite(warm)), static)[1]
    if frames.known_range_m is None or frames.known_range_sd_m is None:
        return None
    used = np.isfinite(frames.known_range_m) & frames.present & ~frames.saturated(sensor)
    spare = int(used.sum()) - unknowns
    if spare < _SPARE:
        return None
    known, sd = frames.known_range_m[used], frames.known_range_sd_m[used]
    factor = frames.gains[used]
    bare = dataclasses.replace(terms, crosstalk=None, background=None)
    light = factor[:, None] * mean_readings(sensor, bare, known)

    def foreseen(ranges: Array) -> Array:
        return static + factor[:, None] * (mean_readings(sensor, terms, ranges) - static)

    off = frames.readings[used] - foreseen(known)
    step = _STEP * known
    slope = (foreseen(known + step) - foreseen(known - step)) / (2.0 * step)[:, None]
    late = delayed(light, np.log(known), *instrument(sensor_at(sensor, terms)))
    by_error = np.stack([light, late], axis=2)
    usable = np.abs(np.linalg.det(by_error)) > 0.0
    spare = int(usable.sum()) - unknowns
    if spare < _SPARE:
        return None
    inverse = np.linalg.inv(by_error[usable])
    errors = (inverse @ off[usable][:, :, None])[:, :, 0]
    # what noise and the ruler alone would show
    read = np.asarray(sensor.noise.read)
    shot = sensor.noise.shot * np.abs(frames.readings[used][usable])
    ruler = (inverse @ slope[usable][:, :, None])[:, :, 0] * sd[usable][:, None]
    variance = (inverse**2 @ (read**2 + shot)[:, :, None])[:, :, 0] + ruler**2
    if sensor.kind == "pulsed":  # late photons are in both windows
        variance += 2.0 * inverse.prod(axis=2) * shot.min(axis=1)[:, None]
    if sensor.noise.flickers:
        flicker = sensor.noise.relative * frames.readings[used][usable]
        variance += np.square((inverse @ flicker[:, :, None])[:, :, 0])
    else:
        variance[:, 0] += sensor.noise.relative**2
    flux, range_m = (_size(e, v, spare) for e, v in zip(errors.T, variance.T, strict=True))
    return LearntError(frames=int(usable.sum()), flux=flux, range_m=range_m)


def _size(errors: Array, variance: Array, spare: int) -> float:
    """Return the size s of errors e whose variances are v + s^2; 0 where chance explains them."""
    free = spare / len(errors)  # the unknowns have taken their part of each square
    most = float(np.max(errors**2 / free - variance))  # no maximum lies beyond
    if most <= 0.0:
        return 0.0

    def deviance(square: float, free: float) -> float:
        total = variance + square
        return float((errors**2 / total + free * np.log(total / variance)).sum())

    def slope(log_square: float) -> float:
        total = variance + np.exp(log_square)
        return float(((free * total - errors**2) / total**2).sum() / (1.0 / total).sum())

    least = _LEAST * min(float(variance.min()), most)
    tried = np.geomspace(least, most, int(np.log(most / least) / _APART) + 2)
    # against n free squares, not fewer: what the unknowns took is no sign of an error
    if deviance(0.0, 1.0) - min(deviance(square, 1.0) for square in tried) < _SHOWN:
        return 0.0
    best = int(np.argmin([deviance(square, free) for square in tried]))
    low, high = np.log(tried[[max(best - 1, 0), min(best + 1, len(tried) - 1)]])
    square = float(tried[best])
    if slope(low) < 0.0 < slope(high):
        square = float(np.exp(scipy.optimize.brentq(slope, low, high)))
    # a frame whose own noise is larger says less of the size; one at least has shown it
    degrees = max(free * float(((square / (variance + square)) ** 2).sum()), 1.0)
    # so that a normal law of this size holds as much as Student's t, which few frames leave
    wider = scipy.stats.t.ppf(_SURE, degrees) / scipy.stats.norm.ppf(_SURE)
    return float(wider * np.sqrt(square))
