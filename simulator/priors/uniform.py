"""Laws that are constant in x or in log x."""

import dataclasses
from typing import Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.priors.distribution import Distribution, RangeForm
from simulator.scipy_later import scipy
from simulator.validated import Number, Positive, Validated

__all__ = ["LogUniform", "Uniform", "UniformDistribution"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class UniformDistribution(Distribution):
    """Constant density in x or log x, fixed by its support alone."""

    def _log_share(self, a: Array, b: Array) -> Array:
        return np.asarray(np.log(b - a))

    def _position(self, z: Array, a: Array, b: Array) -> Array:
        width = b - a
        # from the nearer end, so that both ends are resolved
        from_low, from_high = a + width * scipy.special.ndtr(z), b - width * scipy.special.ndtr(-z)
        return np.asarray(np.where(z < 0, from_low, from_high))

    def _variate(self, position: Array, a: Array, b: Array) -> Array:
        mass = np.log(b - a)
        lower = np.minimum(np.log(position - a) - mass, 0.0)
        upper = np.minimum(np.log(b - position) - mass, 0.0)
        return np.asarray(
            np.where(lower < upper, scipy.special.ndtri_exp(lower), -scipy.special.ndtri_exp(upper))
        )

    def _log_density(self, position: Array, a: Array, b: Array) -> Array:
        return np.asarray(-np.log(b - a) + np.zeros_like(position))

    def _deviation(self, position: Array, a: Array, b: Array) -> Array:
        return np.zeros(np.broadcast(position, a, b).shape)

    @property
    def range_form(self) -> RangeForm:
        """Constant in r, or in log r."""
        return RangeForm(-1.0 if self.log else 0.0)


class Uniform(Validated):
    """Constant density on [low, high]."""

    prior: Literal["uniform"] = "uniform"
    low: Number
    high: Number

    @pydantic.model_validator(mode="after")
    def _ordered(self) -> "Uniform":
        if not self.low < self.high:
            raise ValueError("low must be below high")
        return self

    def distribution(self) -> UniformDistribution:
        """Return the distribution."""
        return UniformDistribution(log=False, low=self.low, high=self.high)


class LogUniform(Validated):
    """Constant density of the logarithm on [low, high], 0 < low."""

    prior: Literal["loguniform"] = "loguniform"
    low: Positive
    high: Positive

    @pydantic.model_validator(mode="after")
    def _ordered(self) -> "LogUniform":
        if not self.low < self.high:
            raise ValueError("low must be below high")
        return self

    def distribution(self) -> UniformDistribution:
        """Return the distribution."""
        return UniformDistribution(log=True, low=self.low, high=self.high)
