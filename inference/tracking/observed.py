"""What a tracker reads of every frame, and the units in which it counts."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.tracking.readings_table import ReadingsNoise
from inference.tracking.settings import TrackingSettings
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["Observed", "observed_of"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Observed:
    """What is read of every frame."""

    by_rate: bool  # whether derivatives in time are read, not the readings themselves
    # noise of the two observables, in which the kernels count [reading units, or a second]
    units: tuple[float, float]
    used: tuple[bool, bool]  # which of the two are used
    noise: ReadingsNoise  # in those units

    @property
    def scale(self) -> Array:
        """From readings to units of the noise, shape (2,); 0 for what is not used."""
        return np.where(self.used, 1.0 / np.asarray(self.units), 0.0)

    @property
    def channels(self) -> int:
        """How many of the two observables are used."""
        return sum(self.used)


def observed_of(sensor: Sensor, settings: TrackingSettings) -> Observed:
    """Return what a tracker with these settings reads.

    Parameters
    ----------
    sensor, settings : Sensor, TrackingSettings
        That go together: derivatives are tracked only where their noise is known.
    """
    by_rate = settings.observables == "derivatives"
    units = sensor.noise.read
    if by_rate and sensor.noise.derivative is not None:
        units = sensor.noise.derivative
    used = (settings.observables != "w2", settings.observables != "w1")
    relative, shot = (0.0, 0.0) if by_rate else (sensor.noise.relative, sensor.noise.shot)
    first, second = units
    noise = ReadingsNoise(
        plain=relative == 0.0 and shot == 0.0,
        shot=shot / second,
        ratio=first / second,
        relative=relative,
        pulsed=isinstance(sensor, PulsedSensor),
        of_source=sensor.noise.flickers,
    )
    return Observed(by_rate, units, used, noise)
