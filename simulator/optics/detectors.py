"""Detectors: where they are, and what they make of the optical power that reaches them."""

import math
from typing import Annotated, Literal

import pydantic
from scipy.constants import elementary_charge, h, speed_of_light

from simulator.optics.vectors import Position, Unit
from simulator.validated import Validated

__all__ = ["Detector", "Geiger", "Photodiode", "dead_time_rate"]

Positive = Annotated[float, pydantic.Field(gt=0)]
Efficiency = Annotated[float, pydantic.Field(gt=0, le=1)]


def dead_time_rate(rate_hz: float, dead_time_s: float) -> float:
    """Return the counted rate of a non-paralysable counter, n / (1 + n t)."""
    return rate_hz / (1.0 + rate_hz * dead_time_s)


class Photodiode(Validated):
    """A photodiode, avalanche or not: I = M (eta q / (h f)) Phi (2.14, 2.15).

    Attributes
    ----------
    quantum_efficiency : float
        eta, in (0, 1].
    wavelength_m : float
        [m].
    avalanche_gain : float
        M, at least 1.
    """

    kind: Literal["photodiode"] = "photodiode"
    quantum_efficiency: Efficiency = 0.8
    wavelength_m: Positive = 850e-9
    avalanche_gain: Annotated[float, pydantic.Field(ge=1)] = 1.0

    @property
    def responsivity(self) -> float:
        """R, current per power before avalanche gain [A/W]."""
        energy = h * speed_of_light / self.wavelength_m
        return self.quantum_efficiency * elementary_charge / energy

    def signal(self, power_w: float) -> float:
        """Return the photocurrent [A] for an optical power [W]."""
        return self.avalanche_gain * self.responsivity * power_w


class Geiger(Validated):
    """A single-photon counter with dead time.

    Attributes
    ----------
    detection_efficiency : float
        Share of photons that trigger, in (0, 1].
    wavelength_m : float
        [m].
    dead_time_s : float
        Time after a count during which nothing is counted (non-paralysable) [s].
    dark_rate_hz : float
        Counts in the dark, before dead time [1/s].
    """

    kind: Literal["geiger"] = "geiger"
    detection_efficiency: Efficiency = 0.3
    wavelength_m: Positive = 850e-9
    dead_time_s: Annotated[float, pydantic.Field(ge=0)] = 0.0
    dark_rate_hz: Annotated[float, pydantic.Field(ge=0)] = 0.0

    def trigger_rate(self, power_w: float) -> float:
        """Return the rate of triggers without dead time [1/s], dark counts included."""
        energy = h * speed_of_light / self.wavelength_m
        return self.detection_efficiency * power_w / energy + self.dark_rate_hz

    def signal(self, power_w: float) -> float:
        """Return the counted rate [1/s] for a steady optical power [W]."""
        return dead_time_rate(self.trigger_rate(power_w), self.dead_time_s)

    def power(self, counted_hz: float) -> float:
        """Return the optical power [W] that gives a counted rate; inf at or past saturation."""
        live = 1.0 - counted_hz * self.dead_time_s
        if live <= 0.0:
            return math.inf
        energy = h * speed_of_light / self.wavelength_m
        return (counted_hz / live - self.dark_rate_hz) * energy / self.detection_efficiency


class Detector(Validated):
    """A small detector with a Lambertian response (its area counts as A_D cos).

    Attributes
    ----------
    position_m : (float, float, float)
        [m].
    normal : (float, float, float)
        Direction in which it looks; normalised on the way in.
    area_m2 : float
        A_D [m^2].
    response : Photodiode or Geiger
        From optical power to current or counts.
    """

    position_m: Position = (0.0, 0.0, 0.0)
    normal: Unit = (0.0, 0.0, 1.0)
    area_m2: Positive = 1e-6
    response: Annotated[Photodiode | Geiger, pydantic.Field(discriminator="kind")] = Photodiode()
