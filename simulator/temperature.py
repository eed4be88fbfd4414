"""How gain and delay of a sensor follow its temperature."""

from typing import Annotated, Self

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.errors import Problem
from simulator.quantity import Quantity
from simulator.validated import Positive, Validated

__all__ = ["COLDEST_K", "Temperature", "temperature_problems"]

Array = NDArray[np.float64]

COLDEST_K = 100.0
"""Below it a temperature is refused [K]: no such sensor works there, and degrees Celsius lie there.

Taken for kelvin, 25 degrees Celsius would change gain and delay by 273 times their drift a kelvin.
"""
_CELSIUS = "in kelvin: 25 degrees Celsius are 298.15"


def _warm(value: float) -> float:
    if value < COLDEST_K:
        raise ValueError(f"is {value:g}, and must be {COLDEST_K:g} or more, {_CELSIUS}")
    return value


_Kelvin = Annotated[
    Positive,
    pydantic.AfterValidator(_warm),
    pydantic.WithJsonSchema({"type": "number", "minimum": COLDEST_K}),
]


class Temperature(Validated):
    """Temperature coefficients of a sensor (docs/model.md, sensor-temperature), one at least.

    Attributes
    ----------
    gain_drift_per_k : Quantity, optional
        Relative change of the gain per kelvin [1/K]. Left out: it does not change.
    delay_drift_s_per_k : Quantity, optional
        By how much later light seems to come per kelvin [s/K]; a sine wave turns by 2 pi f times
        it. Left out: it does not.
    reference_k : float
        Temperature at which gain and delay are what the sensor states [K], `COLDEST_K` or more.
    """

    gain_drift_per_k: Quantity | None = None
    delay_drift_s_per_k: Quantity | None = None
    reference_k: _Kelvin = 298.15

    @pydantic.model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.quantities:
            raise ValueError(
                "states no coefficient: give gain_drift_per_k or delay_drift_s_per_k, or leave "
                "temperature out"
            )
        return self

    @property
    def quantities(self) -> dict[str, Quantity]:
        """The coefficients that are stated, by their names."""
        stated = {
            "gain_drift_per_k": self.gain_drift_per_k,
            "delay_drift_s_per_k": self.delay_drift_s_per_k,
        }
        return {name: value for name, value in stated.items() if value is not None}

    @property
    def known(self) -> tuple[float, float]:
        """Drifts of gain [1/K] and delay [s/K]; 0 where one is left out or not known."""
        gain, delay = self.gain_drift_per_k, self.delay_drift_s_per_k
        return (
            float(gain) if isinstance(gain, float | int) else 0.0,
            float(delay) if isinstance(delay, float | int) else 0.0,
        )


def temperature_problems(of: Temperature | None, temperature_k: Array | None) -> list[Problem]:
    """Find what cannot be a sensor's temperature.

    Parameters
    ----------
    of : Temperature or None
        The sensor's coefficients; without any the column is not used, whatever it holds.
    temperature_k : ndarray, shape (n,), or None
        The column, nan for null [K].
    """
    if of is None:
        return []
    if temperature_k is None:
        message = "is missing: the sensor has temperature coefficients; null where it is not known"
        return [Problem("/temperature_k", message)]
    with np.errstate(invalid="ignore"):
        cold = np.flatnonzero(temperature_k < COLDEST_K)
        dark = np.flatnonzero(1.0 + of.known[0] * (temperature_k - of.reference_k) <= 0)
    if cold.size:
        message = (
            f"entry {cold[0]} is {temperature_k[cold[0]]:g}, and must be {COLDEST_K:g} or more, "
            f"{_CELSIUS}"
        )
        return [Problem("/temperature_k", message)]
    if dark.size:
        message = (
            f"entry {dark[0]} is {temperature_k[dark[0]]:g} K, at which the sensor's "
            "gain_drift_per_k leaves no gain"
        )
        return [Problem("/temperature_k", message)]
    return []
