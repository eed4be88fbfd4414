"""The template of an adapter: what a sensor's own registers say, as frames."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np

from simulator.errors import InvalidInputError, Problem
from simulator.sensor import Sensor

__all__ = ["Adapter", "Converted", "Settings", "converted"]

# wider than any sensor's, and narrow enough that whatever is made of them is a number
_LIMITS = {"frequency_hz": (1.0, 1e12), "period_s": (1e-12, 1e6), "read": (1e-30, 1e30)}


@dataclasses.dataclass(frozen=True, slots=True)
class Settings:
    """What a dump does not say by itself; None where it is left to the adapter.

    Attributes
    ----------
    read : (float, float), optional
        Standard deviations of the two readings [reading units]; left out, the sensor's own figures
        or the scatter of the frames.
    frequency_hz : float, optional
        Modulation frequency [Hz].
    period_s : float, optional
        Time from frame to frame [s], where a dump has no times.
    agc : "linear" or "compensated", optional
        Whether the readings grow with the register of the automatic gain, or were divided by it.
    channel : int, optional
        Which of several emitters counts.
    readings : str, optional
        Which of the forms that a sensor has becomes the two readings.
    """

    read: tuple[float, float] | None = None
    frequency_hz: float | None = None
    period_s: float | None = None
    agc: Literal["linear", "compensated"] | None = None
    channel: int | None = None
    readings: str | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Converted:
    """Frames of a dump.

    Attributes
    ----------
    sensor : PulsedSensor or SineWaveSensor
        With the noise of these frames; gain 1 and no phase offset, since neither is in a dump:
        the notes say what the offset would cost.
    columns : mapping of str to sequence
        Columns of frames, and registers that no frame has a column for.
    notes : tuple of str
        What was left out, and what was supposed.
    """

    sensor: Sensor
    columns: Mapping[str, Sequence[float]]
    notes: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True)
class Adapter:
    """One sensor.

    Attributes
    ----------
    name : str
        As the command line calls it.
    title : str
        What it is.
    source : str
        Where the format of its registers is published.
    forms : tuple of str
        Suffixes of the dumps that it reads.
    settings : frozenset of str
        Members of `Settings` that it takes; any other is refused.
    convert : callable
        (bytes of the dump, its suffix, Settings) -> Converted.
    """

    name: str
    title: str
    source: str
    forms: tuple[str, ...]
    settings: frozenset[str]
    convert: Callable[[bytes, str, Settings], Converted]


def converted(adapter: Adapter, raw: bytes, form: str, settings: Settings) -> Converted:
    """Convert a dump.

    Parameters
    ----------
    adapter : Adapter
        Of the sensor.
    raw : bytes
        The dump.
    form : str
        Its suffix, one of ``adapter.forms``.
    settings : Settings
        What it does not say by itself.

    Raises
    ------
    InvalidInputError
        A pointer for each setting that the adapter does not take or cannot do without, and for what
        is wrong in the dump.
    MalformedError
        Where the dump cannot be read as what its suffix says.
    RefusedError
        Where too few frames are left to tell their noise.
    """
    problems = []
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if value is None:
            continue
        if field.name not in adapter.settings:
            problems.append(Problem(f"/{field.name}", f"says nothing to the {adapter.title}"))
        elif field.name in _LIMITS:
            low, high = _LIMITS[field.name]
            if not all(low <= number <= high for number in np.atleast_1d(value)):
                message = f"must lie between {low:g} and {high:g}"
                problems.append(Problem(f"/{field.name}", message))
    if form not in adapter.forms:
        must = ", ".join(adapter.forms)
        problems.append(Problem("/form", f"a dump of the {adapter.title} is {must}, not '{form}'"))
    if problems:
        raise InvalidInputError(*problems)
    return adapter.convert(raw, form, settings)
