"""Sensors: what turns flux and range into two readings, and with what noise."""

import math
from typing import Annotated, Literal

import pydantic

from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import InvalidInputError
from simulator.validated import NonNegative, Number, Positive, Validated, problems_of

__all__ = ["Noise", "PulsedSensor", "Sensor", "SineWaveSensor", "instrument", "parse_sensor"]

# JSON arrays arrive as lists; the elements stay strict
PositivePair = Annotated[tuple[Positive, Positive], pydantic.Strict(False)]


class Noise(Validated):
    """Noise of a frame's two readings.

    Attributes
    ----------
    read : (float, float)
        Standard deviations in the order w1, w2 or i, q [reading units], positive.
    shot : float
        Variance per mean reading [reading units]; for a pulse cov(w1, w2) = shot * abs(mean w1),
        because the late photons are part of the whole.
    relative : float
        Standard deviation of one common relative error of the object's signal per frame.
    derivative : (float, float), optional
        Standard deviations of the derivative columns [reading units / s].
    """

    read: PositivePair
    shot: NonNegative = 0.0
    relative: NonNegative = 0.0
    derivative: PositivePair | None = None


class _AnySensor(Validated):
    gain: Positive = 1.0
    noise: Noise
    full_scale: PositivePair | None = None


class PulsedSensor(_AnySensor):
    """A pulse and two windows: w1 the late part, w2 the whole; w1 = w2 r / r0.

    Attributes
    ----------
    pulse_width_s : float
        Pulse width T_p [s].
    gain : float
        Reading units per Phi / (Phi0 A_D) [reading units m^2], the thesis's Phi0 A_D T_p.
    noise : Noise
        Noise of the readings.
    full_scale : (float, float), optional
        A reading at or beyond it is saturated.
    """

    kind: Literal["pulsed"] = "pulsed"
    pulse_width_s: Positive

    @property
    def r0(self) -> float:
        """Range at which the whole pulse is late, c T_p / 2 [m]."""
        return SPEED_OF_LIGHT * self.pulse_width_s / 2

    @property
    def max_range_m(self) -> float:
        """Largest range that the readings tell apart [m]."""
        return self.r0

    @property
    def columns(self) -> tuple[str, str]:
        """Names of the two readings."""
        return ("w1", "w2")


class SineWaveSensor(_AnySensor):
    """A sine-wave modulation: i + j q = gain Phi exp(j (k r + phase_offset)).

    Attributes
    ----------
    frequency_hz : float
        Modulation frequency f [Hz].
    phase_offset_rad : float
        Phase at zero range [rad].
    gain : float
        Reading units per Phi / (Phi0 A_D) [reading units m^2], the thesis's Phi0 A_D G.
    noise : Noise
        Noise of the readings.
    full_scale : (float, float), optional
        A reading whose magnitude is at or beyond it is saturated.
    """

    kind: Literal["sine_wave"] = "sine_wave"
    frequency_hz: Positive
    phase_offset_rad: Number = 0.0

    @property
    def wave_number(self) -> float:
        """Phase per range k = 4 pi f / c, the round trip included [rad/m]."""
        return 4 * math.pi * self.frequency_hz / SPEED_OF_LIGHT

    @property
    def max_range_m(self) -> float:
        """Range at which the phase wraps, c / (2 f) [m]."""
        return SPEED_OF_LIGHT / (2 * self.frequency_hz)

    @property
    def columns(self) -> tuple[str, str]:
        """Names of the two readings."""
        return ("i", "q")


Sensor = PulsedSensor | SineWaveSensor

_adapter: pydantic.TypeAdapter[Sensor] = pydantic.TypeAdapter(
    Annotated[Sensor, pydantic.Field(discriminator="kind")]
)


def parse_sensor(data: object) -> Sensor:
    """Validate a sensor given as plain JSON data.

    Parameters
    ----------
    data : object
        Decoded JSON in the form of docs/scenes.md, sensor.

    Returns
    -------
    PulsedSensor or SineWaveSensor
        The sensor that ``kind`` names.

    Raises
    ------
    InvalidInputError
        With a pointer for each offending field.
    """
    try:
        return _adapter.validate_python(data)
    except pydantic.ValidationError as error:
        raise InvalidInputError(*problems_of(error, data)) from None


def instrument(sensor: Sensor) -> tuple[float, tuple[float, float] | None]:
    """Return r0 [m] and, of a sine wave, (k [rad/m], phase offset [rad]), as the kernels take them.

    A pulse has no wave (None), and a sine wave does not read r0.
    """
    if isinstance(sensor, PulsedSensor):
        return sensor.r0, None
    return 0.0, (sensor.wave_number, sensor.phase_offset_rad)
