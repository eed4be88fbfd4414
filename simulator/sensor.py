"""Sensors: what turns flux and range into two readings, and with what noise."""

import math
from typing import Annotated, Literal, TypeVar

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.constants import SPEED_OF_LIGHT
from simulator.errors import InvalidInputError, RefusedError
from simulator.priors import LEAST_LOG_MASS
from simulator.quantity import PositiveQuantity, Quantity
from simulator.temperature import Temperature
from simulator.validated import NonNegative, Positive, Validated, problems_of

__all__ = [
    "Noise",
    "PulsedSensor",
    "Reach",
    "Sensor",
    "SineWaveSensor",
    "instrument",
    "parse_sensor",
    "shift_of",
]

Reach = float | tuple[float, float]
"""r0 of a pulse [m], and with it, where the sensor states a timing offset, c t / 2 [m]."""

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
        Standard deviation of one common relative error per frame.
    relative_of : {"object", "source"}
        What has it: the object's signal, or all light of a source that flickers, which is that of
        crosstalk and background too.
    derivative : (float, float), optional
        Standard deviations of the derivative columns [reading units / s].
    """

    read: PositivePair
    shot: NonNegative = 0.0
    relative: NonNegative = 0.0
    relative_of: Literal["object", "source"] = "object"
    derivative: PositivePair | None = None

    @property
    def flickers(self) -> bool:
        """Whether the relative error is that of all light of the source."""
        return self.relative > 0.0 and self.relative_of == "source"


def _number(value: Quantity, path: str) -> float:
    """Return a quantity that is known."""
    if isinstance(value, float | int):
        return float(value)
    raise RefusedError(
        f"needs {path} as a known number, and the sensor states a prior: calibrate first, which "
        "makes a scene that knows it"
    )


class _AnySensor(Validated):
    gain: PositiveQuantity = 1.0
    noise: Noise
    full_scale: PositivePair | None = None
    temperature: Temperature | None = None

    @pydantic.field_validator("gain")
    @classmethod
    def _has_positive_mass(cls, value: PositiveQuantity) -> PositiveQuantity:
        if isinstance(value, float | int):
            return value
        if not float(value.distribution().log_mass(0.0, math.inf)) > LEAST_LOG_MASS:
            raise ValueError("the prior has no mass above 0")
        return value

    @property
    def known_gain(self) -> float:
        """The gain where it is a number; refused where it is a prior."""
        return _number(self.gain, "sensor.gain")

    @property
    def quantities(self) -> dict[str, Quantity]:
        """What may be unknown of the sensor, by its path; what is left out is not among them."""
        of: dict[str, Quantity] = {"sensor.gain": self.gain}
        if self.temperature is not None:
            drifts = self.temperature.quantities.items()
            of |= {f"sensor.temperature.{name}": value for name, value in drifts}
        return of

    @property
    def unknown(self) -> tuple[str, ...]:
        """Paths of what the sensor states by a prior."""
        return tuple(
            path for path, value in self.quantities.items() if not isinstance(value, float | int)
        )


class PulsedSensor(_AnySensor):
    """A pulse and two windows: w1 the late part, w2 the whole; w1 = w2 r / r0.

    With a timing offset t the late part is (r + c t / 2) / r0 of the whole, within 0 and 1.

    Attributes
    ----------
    pulse_width_s : float
        Pulse width T_p [s].
    timing_offset_s : Quantity, optional
        By how much later than its path tells light seems to come [s]. Left out: there is none.
    gain : Quantity
        Reading units per Phi / (Phi0 A_D) [reading units m^2], the thesis's Phi0 A_D T_p.
    noise : Noise
        Noise of the readings.
    full_scale : (float, float), optional
        A reading at or beyond it is saturated.
    temperature : Temperature, optional
        How gain and delay follow the temperature. Left out: they do not.
    """

    kind: Literal["pulsed"] = "pulsed"
    pulse_width_s: Positive
    timing_offset_s: Quantity | None = None

    @property
    def quantities(self) -> dict[str, Quantity]:
        """What may be unknown of the sensor, by its path; what is left out is not among them."""
        of = super().quantities
        if self.timing_offset_s is not None:
            of["sensor.timing_offset_s"] = self.timing_offset_s
        return of

    @property
    def known_shift_m(self) -> float:
        """The timing offset as a length c t / 2 [m], 0 without one; refused where it is a prior."""
        if self.timing_offset_s is None:
            return 0.0
        return shift_of(_number(self.timing_offset_s, "sensor.timing_offset_s"))

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
    phase_offset_rad : Quantity
        Phase at zero range [rad].
    gain : Quantity
        Reading units per Phi / (Phi0 A_D) [reading units m^2], the thesis's Phi0 A_D G.
    noise : Noise
        Noise of the readings.
    full_scale : (float, float), optional
        A reading whose magnitude is at or beyond it is saturated.
    temperature : Temperature, optional
        How gain and delay follow the temperature. Left out: they do not.
    """

    kind: Literal["sine_wave"] = "sine_wave"
    frequency_hz: Positive
    phase_offset_rad: Quantity = 0.0

    @property
    def quantities(self) -> dict[str, Quantity]:
        """What may be unknown of the sensor, by its path."""
        return {**super().quantities, "sensor.phase_offset_rad": self.phase_offset_rad}

    @property
    def known_phase_rad(self) -> float:
        """The phase offset where it is a number; refused where it is a prior."""
        return _number(self.phase_offset_rad, "sensor.phase_offset_rad")

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
    Annotated[Sensor, pydantic.Field(discriminator="kind")],
    config=pydantic.ConfigDict(defer_build=True),
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


T = TypeVar("T", float, NDArray[np.float64])


def shift_of(timing_offset_s: T) -> T:
    """Return a timing offset as a length, c t / 2 [m]."""
    return timing_offset_s * (SPEED_OF_LIGHT / 2)


def instrument(sensor: Sensor) -> tuple[Reach, tuple[float, float] | None]:
    """Return r0 [m] and, of a sine wave, (k [rad/m], phase offset [rad]), as the kernels take them.

    A pulse has no wave (None), and a sine wave does not read r0. Of a pulse with a timing offset
    r0 comes with its length. What is unknown is 0 here: kernels that know it put it in its place.
    """
    if isinstance(sensor, PulsedSensor):
        if sensor.timing_offset_s is None:
            return sensor.r0, None
        known = isinstance(sensor.timing_offset_s, float | int)
        return (sensor.r0, sensor.known_shift_m if known else 0.0), None
    known = isinstance(sensor.phase_offset_rad, float | int)
    return 0.0, (sensor.wave_number, sensor.known_phase_rad if known else 0.0)
