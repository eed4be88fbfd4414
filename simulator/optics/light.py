"""What a surface returns: flux, effective distance, late window, phasor, and why there is none."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from scipy.constants import speed_of_light

__all__ = ["Light", "Modulation", "Status", "add", "along_one_path", "dark", "scaled"]

Status = Literal["lit", "edge_on", "opposite_faces", "out_of_view", "dark"]

_REASON: dict[Status, str] = {
    "lit": "",
    "edge_on": "emitter or detector lies in the plane of the surface, which is seen edge-on",
    "opposite_faces": "emitter and detector see opposite faces of the surface",
    "out_of_view": "no part of the surface is in front of both emitter and detector",
    "dark": "the surface lies outside the emitter's cone, or returns less than the smallest number",
}


@dataclass(frozen=True, slots=True)
class Modulation:
    """What a sensor does to light in time.

    Attributes
    ----------
    frequency_hz : float, optional
        f of a sine wave.
    pulse_width_s : float, optional
        T_p of a pulse.
    """

    frequency_hz: float | None = None
    pulse_width_s: float | None = None

    @property
    def wave_number(self) -> float:
        """Wave number k = 4 pi f / c [rad/m], 0 without a sine wave."""
        return 4 * math.pi * (self.frequency_hz or 0.0) / speed_of_light

    @property
    def r0(self) -> float:
        """Range r0 = c T_p / 2 [m], 0 without a pulse."""
        return 0.5 * speed_of_light * (self.pulse_width_s or 0.0)


@dataclass(frozen=True, slots=True)
class Light:
    """What one surface returns, per Phi0 A_D.

    Attributes
    ----------
    flux : float
        Phi / (Phi0 A_D) [1/m^2].
    distance_m : float
        Effective distance of a long pulse, the flux-weighted mean of (r_i + r_o)/2 (3.2) [m]; nan
        where there is no light.
    late : float
        int min(r/r0, 1) dPhi (docs/model.md, 2.33); nan without a pulse.
    phasor : complex
        int exp(j k r) dPhi (docs/model.md, 3.19); nan without a sine wave.
    error : float
        Estimated relative error of the flux.
    status : str
        "lit", or why the flux is zero.
    """

    flux: float
    distance_m: float
    late: float
    phasor: complex
    error: float
    status: Status

    @property
    def reason(self) -> str:
        """Why the flux is zero; empty where it is not."""
        return _REASON[self.status]

    def phase_distance_m(self, modulation: Modulation) -> float:
        """Return the effective distance of a sine wave, arg(phasor)/k in [0, 2 pi/k) [m]."""
        k = modulation.wave_number
        if not k > 0 or self.flux == 0:
            return math.nan
        return (math.atan2(self.phasor.imag, self.phasor.real) % (2 * math.pi)) / k

    def pulse_distance_m(self, modulation: Modulation) -> float:
        """Return the effective distance of a pulse, r0 late/flux, at most r0 [m]."""
        if not modulation.r0 > 0 or self.flux == 0:
            return math.nan
        return modulation.r0 * self.late / self.flux


def dark(status: Status) -> Light:
    """Return no light, with its reason."""
    return Light(0.0, math.nan, 0.0, 0j, 0.0, status)


def along_one_path(flux: float, path_m: float, modulation: Modulation, status: Status) -> Light:
    """Return light that has come one way, without an error of quadrature.

    Parameters
    ----------
    flux : float
        Phi / (Phi0 A_D) [1/m^2].
    path_m : float
        Half the length of the way [m].
    modulation : Modulation
        What the sensor does to light in time.
    status : str
        As of `Light`.
    """
    phase = modulation.wave_number * path_m
    return Light(
        flux=flux,
        distance_m=path_m,
        late=flux * min(path_m / modulation.r0, 1.0) if modulation.r0 > 0 else math.nan,
        phasor=(
            flux * complex(math.cos(phase), math.sin(phase))
            if modulation.wave_number > 0
            else complex(math.nan, math.nan)
        ),
        error=0.0,
        status=status,
    )


def add(lights: Sequence[Light]) -> Light:
    """Return the light of several surfaces that do not hide one another (3.26).

    Flux, late window and phasor add; the distance is the flux-weighted mean.
    """
    flux = math.fsum(light.flux for light in lights)
    if flux == 0.0:
        return dark(lights[0].status if lights else "out_of_view")
    lit = [light for light in lights if light.flux != 0]
    return Light(
        flux=flux,
        distance_m=math.fsum(light.flux * light.distance_m for light in lit) / flux,
        late=math.fsum(light.late for light in lit),
        phasor=sum((light.phasor for light in lit), 0j),
        error=math.fsum(abs(light.flux) * light.error for light in lit) / abs(flux),
        status="lit",
    )


def scaled(light: Light, factor: float) -> Light:
    """Return light times a factor (negative: taken away from a sum)."""
    return Light(
        flux=factor * light.flux,
        distance_m=light.distance_m,
        late=factor * light.late,
        phasor=factor * light.phasor,
        error=light.error,
        status=light.status,
    )
