"""What is valid, and yet looks like a mistake: a wrong unit, a noise that cannot be so small."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inference.assumptions import doubtful_unit
from inference.smoothed_readings import smoothed_readings
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["LOOKED", "doubts", "noise_doubts", "time_doubts"]

Array = NDArray[np.float64]

LOOKED = 32
"""Frames of a stream by which its noise and its times are looked at, once."""

# a few numbers that were typed are round by themselves
_FEWEST = 6
# decimal digits to which a double is exact
_DIGITS = 15
# a rounding has the standard deviation of its step over sqrt(12); noise below a tenth of that is
# nothing beside it
_SMALL = 0.1 / math.sqrt(12.0)
_SLOW_S = 10.0  # whole numbers in such steps are milliseconds, or nobody is in a hurry;
_MINUTE_S = 60.0  # in whole minutes it is the latter
_EPOCH_S = 1e11  # the year 5138
# times come in bursts where so many of the steps between them are a small share of the mean step,
# and so many steps at least are longer than that: frames that are missing leave no short steps,
# and one pause is no burst
_SHORT, _OFTEN, _PAUSES = 0.1, 1.0 / 3.0, 3


def doubts(sensor: Sensor, frames: Frames | None = None) -> list[str]:
    """Name what looks like a mistake.

    Parameters
    ----------
    sensor : Sensor
        As stated.
    frames : Frames, optional
        Its frames.

    Returns
    -------
    list of str
        Sentences for a person; nothing follows from them.
    """
    doubt = doubtful_unit(sensor)
    found = [] if doubt is None else [doubt]
    if frames is not None:
        found += noise_doubts(sensor, frames.readings)
        if doubt := smoothed_readings(sensor, frames):
            found.append(doubt)
        if frames.time_s is not None:
            found += time_doubts(frames.time_s)
    return found


def noise_doubts(sensor: Sensor, readings: Array) -> Iterator[str]:
    """Yield for each column that is rounded by more than its stated noise that it is.

    Parameters
    ----------
    sensor : Sensor
        As stated.
    readings : ndarray, shape (n, 2)
        Of some of its frames.

    Yields
    ------
    str
        A sentence for a person.
    """
    for k, column in enumerate(sensor.columns):
        values = np.abs(readings[:, k])
        step = _rounding(values)
        if step is None:
            continue
        sd = math.sqrt(sensor.noise.read[k] ** 2 + sensor.noise.shot * float(np.median(values)))
        if sd < _SMALL * step:
            yield (
                f"{column} is rounded to {step:g}, and its stated noise is {sensor.noise.read[k]:g}"
                f": state {step / math.sqrt(12.0):.2g} or more in noise.read, or standard "
                "deviations are too small"
            )


def _rounding(values: Array) -> float | None:
    """Return the power of ten to which values are rounded; None for those that are not."""
    # unique and median import masked arrays, which takes longer than a few frames do
    if values.size < _FEWEST or np.unique(values).size < _FEWEST:
        return None
    largest = math.floor(math.log10(values.max()))
    for digits in range(1, _DIGITS - 2):
        step = 10.0 ** (largest + 1 - digits)
        multiples = values / step
        if np.all(np.abs(multiples - np.round(multiples)) <= 10.0 ** (digits - _DIGITS)):
            return step
    return None


def time_doubts(time_s: Array) -> Iterator[str]:
    """Yield whether times look like milliseconds, or like those of reading and not of measuring.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Of some frames, in their order; of none nothing is said.

    Yields
    ------
    str
        A sentence for a person.
    """
    if not time_s.size:
        return
    if np.abs(time_s).max() > _EPOCH_S:
        yield f"time_s holds {time_s[0]:.15g}: are these milliseconds?"
    elif time_s.size >= _FEWEST and np.array_equal(time_s, np.round(time_s)):
        step = float(np.median(np.abs(np.diff(time_s))))
        if step >= _SLOW_S and step % _MINUTE_S:
            yield f"time_s holds whole numbers in steps of {step:g}: are these milliseconds?"
    steps = np.diff(time_s)
    if steps.size < _FEWEST or steps.min() < 0.0 or not steps.mean() > 0.0:
        return
    short, pauses = steps < _SHORT * steps.mean(), steps > steps.mean()
    if short.mean() >= _OFTEN and pauses.sum() >= _PAUSES:
        yield (
            f"time_s comes in bursts, {short.mean():.0%} of its steps being shorter than a tenth "
            f"of their mean, {steps.mean():.3g} s: are these the times at which frames were read, "
            "and not those at which they were measured? A tracker then sees motion that was not, "
            "and its ranges may be far off: give frames of one rate times in equal steps"
        )
