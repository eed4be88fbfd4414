"""C99 of a technique: its text, its proven error, and how numbers are written in it."""

import dataclasses
import math
from collections.abc import Callable, Mapping

from inference.known import Known
from simulator.model_error import ModelError
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["ROUNDING", "Asked", "Bound", "Exported", "Generator", "literal", "noise_lines"]

ROUNDING: Mapping[str, float] = {"double": 2.0**-53, "float": 2.0**-24}
"""Unit of rounding of each type."""


@dataclasses.dataclass(frozen=True, slots=True)
class Bound:
    """How far an exported range lies from the exact one of the same readings.

    Attributes
    ----------
    method : float
        Largest error of the method alone [m]: of a table; 0 of a closed form or a bracket.
    relative : float
        Of the range, in units of rounding.
    absolute_m : float
        In units of rounding [m].
    crosstalk : float
        By rounding of the crosstalk, in units of rounding times the standard deviation by noise.
    readings : (float, float)
        By rounding of differences of readings: units of rounding times each reading over its read
        noise, times the standard deviation by noise.
    read : (float, float)
        That read noise [reading units].
    """

    method: float
    relative: float
    absolute_m: float
    crosstalk: float
    readings: tuple[float, float]
    read: tuple[float, float]

    def of(self, kind: str, range_m: float, sd_m: float, readings: tuple[float, float]) -> float:
        """Return the bound for one frame [m].

        Parameters
        ----------
        kind : "float" or "double"
            The type.
        range_m, sd_m : float
            The exact range, and its standard deviation by noise, of first order [m].
        readings : (float, float)
            Of the frame.
        """
        share = self.crosstalk
        share += sum(
            k * abs(w) / s for k, w, s in zip(self.readings, readings, self.read, strict=True)
        )
        rounded = self.relative * range_m + self.absolute_m + share * sd_m
        return self.method + ROUNDING[kind] * rounded


@dataclasses.dataclass(frozen=True, slots=True)
class Asked:
    """What is exported.

    Attributes
    ----------
    technique : str
        Its name.
    known : Known
        The scene's numbers.
    error : ModelError
        How wrong its model may be.
    tolerance : float
        Largest error of a table, relative to the range.
    """

    technique: str
    sensor: Sensor
    scene: Scene
    known: Known
    error: ModelError
    tolerance: float


@dataclasses.dataclass(frozen=True, slots=True)
class Exported:
    """C of a technique.

    Attributes
    ----------
    constants : mapping of str to float
        Defined at its head, in the type of the computation.
    tables : mapping of str to sequence of float
        Arrays.
    body : str
        Functions; ``@`` stands for the name with which names begin.
    bound : Bound
        Its proven error.
    proof : str
        Where that comes from.
    limits_m : (float, float)
        Between which it answers [m].
    """

    constants: Mapping[str, float]
    tables: Mapping[str, tuple[float, ...]]
    body: str
    bound: Bound
    proof: str
    limits_m: tuple[float, float]


Generator = Callable[[Asked], Exported]


def literal(value: float) -> str:
    """Return a number as a literal of the type of the computation.

    Raises
    ------
    ValueError
        Where it is not finite.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no literal of C")
    return f"R({float(value)!r})"


def noise_lines(sensor: Sensor) -> str:
    """Return C that fills own1, own2 and shared, the independent parts of the readings' noise."""
    if sensor.kind == "pulsed":
        shared = "const real shared = SHOT * (fabs1 < fabs2 ? fabs1 : fabs2);"
    else:
        shared = "const real shared = R(0.0);"
    return f"""    const real fabs1 = first < 0 ? -first : first;
    const real fabs2 = second < 0 ? -second : second;
    {shared}
    const real own1 = READ1 * READ1 + SHOT * fabs1 - shared;
    const real own2 = READ2 * READ2 + SHOT * fabs2 - shared;
"""
