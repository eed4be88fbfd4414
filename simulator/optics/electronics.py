"""What electronics do to readings: drift, dead time, noise, full scale and resolution."""

import math
from typing import Annotated

import numpy as np
import pydantic
from scipy.constants import h, speed_of_light

from simulator.errors import InvalidInputError
from simulator.optics.detectors import Detector, Geiger, dead_time_rate
from simulator.optics.emitters import Emitter
from simulator.optics.light import Light
from simulator.readings import light_that_errs
from simulator.sensor import PulsedSensor, Sensor
from simulator.validated import Validated

__all__ = ["Electronics", "digitise", "draw_noise", "mean_pair", "physical_gain", "saturation"]

Pair = tuple[float, float]


class Electronics(Validated):
    """Departures of a circuit from the ideal sensor.

    Attributes
    ----------
    adc_bits : int, optional
        Resolution: a reading is rounded to 2^bits levels over the sensor's full scale (from zero
        for a pulse, from minus full scale for a sine wave). Left out: not rounded.
    gain_drift_per_k : float
        Relative change of gain per kelvin.
    delay_drift_s_per_k : float
        Change of the round-trip delay per kelvin [s/K]; a sine wave turns by 2 pi f times it.
    reference_k : float
        Temperature at which the sensor was calibrated [K].
    crosstalk : (float, float)
        Electrical crosstalk in reading units, w1, w2 or i, q.
    """

    adc_bits: Annotated[int, pydantic.Field(ge=1, le=52)] | None = None
    gain_drift_per_k: float = 0.0
    delay_drift_s_per_k: float = 0.0
    reference_k: Annotated[float, pydantic.Field(gt=0)] = 298.15
    crosstalk: Annotated[tuple[float, float], pydantic.Strict(False)] = (0.0, 0.0)


def physical_gain(emitter: Emitter, detector: Detector, integration_s: float) -> float:
    """Return the sensor gain that physics gives: reading units per Phi/(Phi0 A_D) [m^2].

    Parameters
    ----------
    emitter, detector : Emitter, Detector
        Power, area and response.
    integration_s : float
        T_p times the number of pulses, or T_int/2 of a sine wave (docs/model.md, conventions) [s].

    Returns
    -------
    float
        Coulombs for a photodiode, counts for a photon counter (dead time not included: it is not
        linear, see `saturation`).
    """
    energy = emitter.power_w * detector.area_m2 * integration_s
    response = detector.response
    if isinstance(response, Geiger):
        return energy * response.detection_efficiency * response.wavelength_m / (h * speed_of_light)
    return energy * response.responsivity * response.avalanche_gain


def saturation(emitter: Emitter, detector: Detector, flux: float) -> float:
    """Return the counted share of triggers of a photon counter, 1 for a photodiode.

    Parameters
    ----------
    flux : float
        Phi / (Phi0 A_D) [1/m^2] while the light arrives.
    """
    response = detector.response
    if not isinstance(response, Geiger):
        return 1.0
    rate = response.trigger_rate(emitter.power_w * detector.area_m2 * flux)
    return dead_time_rate(rate, response.dead_time_s) / rate if rate > 0 else 1.0


def mean_pair(light: Light, sensor: Sensor, delay_s: float = 0.0) -> Pair:
    """Return the mean readings of light: late and whole, or i and q (docs/model.md, conventions).

    Parameters
    ----------
    light : Light
        Observed with the sensor's own modulation.
    sensor : Sensor
        Gain, pulse or frequency, phase offset.
    delay_s : float
        Extra round-trip delay [s].
    """
    if light.flux == 0.0:
        return 0.0, 0.0
    if isinstance(sensor, PulsedSensor):
        # exact while no light passes from wholly inside the pulse to wholly late
        shift = 0.5 * speed_of_light * delay_s / sensor.r0
        late = min(max(light.late + light.flux * shift, 0.0), light.flux)
        return sensor.known_gain * late, sensor.known_gain * light.flux
    phase = sensor.known_phase_rad + 2 * math.pi * sensor.frequency_hz * delay_s
    value = sensor.known_gain * light.phasor * complex(math.cos(phase), math.sin(phase))
    return value.real, value.imag


def draw_noise(sensor: Sensor, mean: Pair, signal: Pair, rng: np.random.Generator) -> Pair:
    """Draw the noise of one frame (docs/scenes.md, sensor).

    Parameters
    ----------
    sensor : Sensor
        Noise model.
    mean, signal : (float, float)
        Mean readings, and the objects' part of them.
    """
    noise = sensor.noise
    normal = rng.standard_normal(5)
    first, second = noise.read[0] * normal[0], noise.read[1] * normal[1]
    if isinstance(sensor, PulsedSensor):
        # late photons are part of the whole: early and late parts are independent
        late = math.sqrt(noise.shot * abs(mean[0])) * normal[2]
        early = math.sqrt(noise.shot * max(abs(mean[1]) - abs(mean[0]), 0.0)) * normal[3]
        first, second = first + late, second + late + early
    else:
        first += math.sqrt(noise.shot * abs(mean[0])) * normal[2]
        second += math.sqrt(noise.shot * abs(mean[1])) * normal[3]
    common = noise.relative * normal[4]
    errs = light_that_errs(mean, signal, noise.flickers)
    return float(first + common * errs[0]), float(second + common * errs[1])


def digitise(sensor: Sensor, electronics: Electronics, reading: Pair) -> tuple[Pair, bool]:
    """Clip a reading at full scale and round it to the converter's levels.

    Returns
    -------
    reading : (float, float)
        What the converter delivers.
    saturated : bool
        Whether a reading is at or beyond full scale.

    Raises
    ------
    InvalidInputError
        If a resolution is given without a full scale.
    """
    if sensor.full_scale is None:
        if electronics.adc_bits is not None:
            raise InvalidInputError.at(
                "/electronics/adc_bits", "a resolution needs the sensor's full_scale"
            )
        return reading, False
    low = 0.0 if isinstance(sensor, PulsedSensor) else -1.0
    saturated = any(abs(r) >= s for r, s in zip(reading, sensor.full_scale, strict=True))
    values = []
    for value, scale in zip(reading, sensor.full_scale, strict=True):
        clipped = min(max(value, low * scale), scale)
        if electronics.adc_bits is not None:
            step = (1.0 - low) * scale / (2**electronics.adc_bits - 1)
            clipped = low * scale + step * round((clipped - low * scale) / step)
        values.append(clipped)
    return (values[0], values[1]), saturated
