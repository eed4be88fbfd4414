"""Priors of the scene language as distributions that know their map from the standard normal.

Every prior is a uniform or a normal in x or in log x, cut to a support. An unknown is sampled in
the coordinate z in which its prior is the standard normal: unbounded, near unit scale whatever the
units, and the posterior's spread in z is its contraction against the prior.
"""

import dataclasses
import math
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray
from scipy import special

from simulator.validated import Number, Positive, Validated

__all__ = [
    "LEAST_LOG_MASS",
    "Distribution",
    "HalfNormal",
    "LogNormal",
    "LogUniform",
    "Normal",
    "Prior",
    "TruncatedNormal",
    "Uniform",
]

Array = NDArray[np.float64]

LEAST_LOG_MASS = -700.0  # of a law inside its support: a share of 1e-304, below are no numbers

_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)


def _log_difference(larger: Array, smaller: Array) -> Array:
    """Return log(exp(larger) - exp(smaller)) without cancellation, -inf where they are equal."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gap = np.minimum(smaller - larger, 0.0)
        result = np.where(gap > -math.log(2), np.log(-np.expm1(gap)), np.log1p(-np.exp(gap)))
    return np.asarray(np.where(np.isneginf(larger), -np.inf, larger + result))


def _log_normal_mass(low: Array, high: Array) -> Array:
    """Return log(Phi(high) - Phi(low)), accurate in both tails."""
    # reflected so that the interval lies mostly in the lower tail, where Phi has full precision
    flip = low + high > 0
    below = np.where(flip, -high, low)
    above = np.where(flip, -low, high)
    return _log_difference(special.log_ndtr(above), special.log_ndtr(below))


@dataclasses.dataclass(frozen=True, slots=True)
class Distribution:
    """A uniform or normal law in x or log x, cut to the support [low, high].

    Attributes
    ----------
    base : "uniform" or "normal"
        The law before the cut; a uniform is fixed by its support alone.
    log : bool
        Whether the law is that of log x.
    loc, scale : float
        Mean and standard deviation of a normal, in x or log x (unused by a uniform).
    low, high : float
        Support in x. ``truncated`` accepts arrays, one bound a sample.
    """

    base: Literal["uniform", "normal"]
    log: bool
    loc: float
    scale: float
    low: float
    high: float

    def _coordinate(self, x: Any) -> Array:
        # below zero a law of log x has no density: nan, which every comparison refuses
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(x) if self.log else x, dtype=float)

    def _bounds(self, low: Any, high: Any) -> tuple[Array, Array]:
        """Bounds in the law's own coordinate, standardised for a normal."""
        a = self._coordinate(np.maximum(low, self.low))
        b = self._coordinate(np.minimum(high, self.high))
        if self.base == "normal":
            with np.errstate(over="ignore"):
                return (a - self.loc) / self.scale, (b - self.loc) / self.scale
        return a, b

    def log_mass(self, low: Any = -np.inf, high: Any = np.inf) -> Array:
        """Log of the probability between two bounds, the own support's being 1.

        Parameters
        ----------
        low, high : array_like
            Bounds in x.

        Returns
        -------
        ndarray
            0 for the whole support, -inf where nothing is left.
        """
        low = np.maximum(low, 0.0) if self.log else low
        a, b = self._bounds(low, high)
        whole_a, whole_b = self._bounds(self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.base == "normal":
                mass = _log_normal_mass(a, b) - _log_normal_mass(whole_a, whole_b)
            else:
                mass = np.log(b - a) - np.log(whole_b - whole_a)
        return np.asarray(np.where(b > a, mass, -np.inf))

    def from_normal(self, z: Any, low: Any = -np.inf, high: Any = np.inf) -> Array:
        """Map standard normal variates to this law cut to [low, high].

        Parameters
        ----------
        z : array_like
            Standard normal variates.
        low, high : array_like
            Further cut of the support; something must be left.

        Returns
        -------
        ndarray
            x, increasing in z; inf or 0 where the law reaches beyond what a number can hold.
        """
        z = np.asarray(z, dtype=float)
        low = np.maximum(low, 0.0) if self.log else low
        a, b = self._bounds(low, high)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            if self.base == "normal":
                if np.all(np.isneginf(a)) and np.all(np.isposinf(b)):
                    position = self.loc + self.scale * z
                    return np.asarray(np.exp(position) if self.log else position)
                position = self.loc + self.scale * self._cut_normal(z, a, b)
            else:
                width = b - a
                # from the nearer end, so that both ends are resolved
                from_low, from_high = a + width * special.ndtr(z), b - width * special.ndtr(-z)
                position = np.where(z < 0, from_low, from_high)
            x = np.exp(position) if self.log else position
        # exp(log(x)) may leave the support by a rounding, where the density is zero
        return np.asarray(np.clip(x, np.maximum(low, self.low), np.minimum(high, self.high)))

    @staticmethod
    def _cut_normal(z: Array, a: Array, b: Array) -> Array:
        mass = _log_normal_mass(a, b)
        lower = np.logaddexp(special.log_ndtr(a), special.log_ndtr(z) + mass)
        upper = np.logaddexp(special.log_ndtr(-b), special.log_ndtr(-z) + mass)
        inside = np.where(lower < upper, special.ndtri_exp(lower), -special.ndtri_exp(upper))
        return np.clip(inside, a, b)

    def to_normal(self, x: Any, low: Any = -np.inf, high: Any = np.inf) -> Array:
        """Inverse of `from_normal`: -inf or inf at the ends of the support.

        Parameters
        ----------
        x : array_like
            Values inside the cut support.
        low, high : array_like
            The cut.

        Returns
        -------
        ndarray
            z.
        """
        low = np.maximum(low, 0.0) if self.log else low
        a, b = self._bounds(low, high)
        position = self._coordinate(x)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.base == "normal":
                standard = (position - self.loc) / self.scale
                if np.all(np.isneginf(a)) and np.all(np.isposinf(b)):
                    return standard
                mass = _log_normal_mass(a, b)
                lower = _log_normal_mass(a, standard) - mass
                upper = _log_normal_mass(standard, b) - mass
            else:
                mass = np.log(b - a)
                lower, upper = np.log(position - a) - mass, np.log(b - position) - mass
            lower, upper = np.minimum(lower, 0.0), np.minimum(upper, 0.0)
            return np.asarray(
                np.where(lower < upper, special.ndtri_exp(lower), -special.ndtri_exp(upper))
            )

    def log_density(self, x: Any) -> Array:
        """Log density of x [1 / unit of x], -inf outside the support."""
        x = np.asarray(x, dtype=float)
        position = self._coordinate(x)
        a, b = self._bounds(self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.base == "normal":
                standard = (position - self.loc) / self.scale
                density = -0.5 * standard**2 - _HALF_LOG_2PI - math.log(self.scale)
                density = density - _log_normal_mass(a, b)
            else:
                density = -np.log(b - a) + np.zeros_like(position)
            if self.log:
                density = density - position
        # a law of log x has no density at x = 0, where both of its terms are infinite
        inside = (x >= self.low) & (x <= self.high) & ~np.isnan(density)
        return np.asarray(np.where(inside, density, -np.inf))

    def truncated(self, low: float = -math.inf, high: float = math.inf) -> "Distribution":
        """Return the same law on a smaller support, renormalised."""
        return dataclasses.replace(self, low=max(low, self.low), high=min(high, self.high))


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

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("uniform", False, 0.0, 1.0, self.low, self.high)


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

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("uniform", True, 0.0, 1.0, self.low, self.high)


class Normal(Validated):
    """Normal law of given mean and standard deviation."""

    prior: Literal["normal"] = "normal"
    mean: Number
    sd: Positive

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("normal", False, self.mean, self.sd, -math.inf, math.inf)


class HalfNormal(Validated):
    """Absolute value of a normal variate of mean 0; sd is that of the whole normal."""

    prior: Literal["halfnormal"] = "halfnormal"
    sd: Positive

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("normal", False, 0.0, self.sd, 0.0, math.inf)


class LogNormal(Validated):
    """Law whose logarithm is normal with mean log(median) and standard deviation sigma."""

    prior: Literal["lognormal"] = "lognormal"
    median: Positive
    sigma: Annotated[Positive, pydantic.Field(le=100)]

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("normal", True, math.log(self.median), self.sigma, 0.0, math.inf)


class TruncatedNormal(Validated):
    """Normal law cut to [low, high] and renormalised."""

    prior: Literal["truncated_normal"] = "truncated_normal"
    mean: Number
    sd: Positive
    low: Number
    high: Number

    @pydantic.model_validator(mode="after")
    def _ordered(self) -> "TruncatedNormal":
        if not self.low < self.high:
            raise ValueError("low must be below high")
        whole = Distribution("normal", False, self.mean, self.sd, -math.inf, math.inf)
        if not whole.log_mass(self.low, self.high) > LEAST_LOG_MASS:
            raise ValueError("the law has no mass between low and high that a number can hold")
        return self

    def distribution(self) -> Distribution:
        """Return the distribution."""
        return Distribution("normal", False, self.mean, self.sd, self.low, self.high)


Prior = Annotated[
    Uniform | LogUniform | Normal | HalfNormal | LogNormal | TruncatedNormal,
    pydantic.Field(discriminator="prior"),
]
