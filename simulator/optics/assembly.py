"""A scene of surfaces before a sensor: from shapes and poses to two readings."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pydantic

from simulator.errors import InvalidInputError
from simulator.optics.crosstalk import CoverGlass, glass_crosstalk
from simulator.optics.detectors import Detector
from simulator.optics.electronics import Electronics, digitise, draw_noise, mean_pair, saturation
from simulator.optics.emitters import Emitter
from simulator.optics.extended import point_emitters
from simulator.optics.light import Light, Modulation, add, dark, scaled
from simulator.optics.occlusion import hidden_pair
from simulator.optics.radiometry import observe_batch, observe_shell, shadow
from simulator.optics.surfaces import Shell, Surface
from simulator.sensor import PulsedSensor, Sensor
from simulator.temperature import COLDEST_K
from simulator.validated import Validated

__all__ = ["OpticalScene", "Reading", "SceneLight", "illuminate", "modulation_of", "read"]

Pair = tuple[float, float]


class OpticalScene(Validated):
    """What stands before the sensor, and the sensor's own optics.

    Attributes
    ----------
    surfaces : tuple of Rectangle, Disk, Plane or Sphere
        They must not hide one another (their light adds, 3.26).
    background : Shell, optional
        Around everything; the surfaces cast their exact shadow on it.
    emitter : Emitter
        Default: uniform, at the origin, along +z.
    detector : Detector
        Default: at the origin, along +z.
    cover_glass : CoverGlass, optional
        Its reflections are optical crosstalk.
    electronics : Electronics
        Departures from the ideal circuit.
    """

    surfaces: Annotated[
        tuple[Surface, ...], pydantic.Strict(False), pydantic.Field(max_length=1000)
    ] = ()
    background: Shell | None = None
    emitter: Emitter = Emitter()
    detector: Detector = Detector()
    cover_glass: CoverGlass | None = None
    electronics: Electronics = Electronics()


@dataclass(frozen=True, slots=True)
class SceneLight:
    """Light of a scene by its sources, per Phi0 A_D.

    Attributes
    ----------
    surfaces : tuple of Light
        Of every surface.
    objects : Light
        Of all surfaces together; its distance is the truth r_e.
    background : Light
        What is left of the background beside the shadows.
    bare_background : Light
        The background without any surface.
    glass : Light
        Crosstalk of the cover glass.
    """

    surfaces: tuple[Light, ...]
    objects: Light
    background: Light
    bare_background: Light
    glass: Light

    @property
    def visible_share(self) -> float:
        """S, the share of the background that is not hidden; nan without a background."""
        bare = self.bare_background.flux
        return self.background.flux / bare if bare > 0 else math.nan


@dataclass(frozen=True, slots=True)
class Reading:
    """Readings of one frame with their truth.

    Attributes
    ----------
    values : (float, float)
        w1, w2 or i, q [reading units], as delivered.
    mean : (float, float)
        The same without noise, clipping and rounding.
    signal : (float, float)
        The surfaces' part of the mean.
    saturated : bool
        Whether a reading is at or beyond full scale.
    light : SceneLight
        What the light did.
    """

    values: Pair
    mean: Pair
    signal: Pair
    saturated: bool
    light: SceneLight


def modulation_of(sensor: Sensor) -> Modulation:
    """Return the modulation of a sensor."""
    if isinstance(sensor, PulsedSensor):
        return Modulation(pulse_width_s=sensor.pulse_width_s)
    return Modulation(frequency_hz=sensor.frequency_hz)


def illuminate(
    scene: OpticalScene, modulation: Modulation | None = None, *, tolerance: float = 1e-10
) -> SceneLight:
    """Return the light of a scene.

    Parameters
    ----------
    modulation : Modulation, optional
        Of the sensor; without it late windows and phasors are nan.
    tolerance : float
        Relative, of each flux.

    Raises
    ------
    InvalidInputError
        If surfaces hide one another, emitter or detector lies inside a sphere or outside the
        background, or a shadow is asked for with emitter and detector apart.
    """
    modulation = modulation or Modulation()
    pair = hidden_pair(scene.surfaces, scene.emitter, scene.detector)
    if pair is not None:
        raise InvalidInputError.at(
            f"/surfaces/{pair[1]}",
            f"is hidden in part by surface {pair[0]}: the light of surfaces that overlap in the "
            "field of view does not add",
        )
    sources = point_emitters(scene.emitter)
    detector = scene.detector
    totals: list[list[Light]] = [[] for _ in scene.surfaces]
    for weight, emitter in sources:
        lights = observe_batch(scene.surfaces, emitter, detector, modulation, tolerance=tolerance)
        for parts, light in zip(totals, lights, strict=True):
            parts.append(scaled(light, weight))
    surfaces = tuple(add(parts) for parts in totals)
    bare = left = dark("out_of_view")
    if scene.background is not None:
        shell = scene.background
        bare = add(
            [
                scaled(observe_shell(shell, e, detector, modulation, tolerance=tolerance), w)
                for w, e in sources
            ]
        )
        hidden = [
            scaled(shadow(s, shell, e, detector, modulation, tolerance=tolerance), -w)
            for s in scene.surfaces
            for w, e in sources
        ]
        left = add([bare, *hidden])
    glass = dark("out_of_view")
    if scene.cover_glass is not None:
        glass = add(
            [
                scaled(glass_crosstalk(scene.cover_glass, e, detector, modulation), w)
                for w, e in sources
            ]
        )
    return SceneLight(surfaces, add(surfaces), left, bare, glass)


def read(
    scene: OpticalScene,
    sensor: Sensor,
    rng: np.random.Generator | None = None,
    *,
    temperature_k: float | None = None,
    tolerance: float = 1e-10,
) -> Reading:
    """Return what a sensor reads of a scene.

    Parameters
    ----------
    rng : numpy.random.Generator, optional
        Source of noise; without it the readings are free of noise (but clipped and rounded).
    temperature_k : float, optional
        Default: the temperature of calibration [K].
    tolerance : float
        Relative, of each flux.

    Raises
    ------
    InvalidInputError
        As `illuminate`; for a temperature that no sensor has; for a resolution without a full
        scale.
    """
    electronics = scene.electronics
    warm = 0.0
    if temperature_k is not None:
        if not COLDEST_K <= temperature_k < math.inf:
            message = f"must be a temperature in kelvin, {COLDEST_K:g} or more"
            raise InvalidInputError.at("/temperature_k", message)
        warm = temperature_k - electronics.reference_k
    light = illuminate(scene, modulation_of(sensor), tolerance=tolerance)
    everything = light.objects.flux + light.background.flux + light.glass.flux
    factor = (1.0 + electronics.gain_drift_per_k * warm) * saturation(
        scene.emitter, scene.detector, everything
    )
    delay = electronics.delay_drift_s_per_k * warm
    parts = [
        mean_pair(part, sensor, delay) for part in (light.objects, light.background, light.glass)
    ]
    signal = (factor * parts[0][0], factor * parts[0][1])
    mean = (
        factor * math.fsum(p[0] for p in parts) + electronics.crosstalk[0],
        factor * math.fsum(p[1] for p in parts) + electronics.crosstalk[1],
    )
    values = mean
    if rng is not None:
        noise = draw_noise(sensor, mean, signal, rng)
        values = (mean[0] + noise[0], mean[1] + noise[1])
    values, saturated = digitise(sensor, electronics, values)
    return Reading(values, mean, signal, saturated, light)
