"""Laws that are normal in x or in log x, whole or cut."""

import dataclasses
import functools
import math
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.priors.distribution import LEAST_LOG_MASS, Distribution, RangeForm
from simulator.scipy_later import scipy
from simulator.validated import Number, Positive, Validated

__all__ = [
    "HalfNormal",
    "LogNormal",
    "Normal",
    "NormalDistribution",
    "TruncatedNormal",
]

Array = NDArray[np.float64]

_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)


def _log_difference(larger: Array, smaller: Array) -> Array:
    """Return log(exp(larger) - exp(smaller)) without cancellation, -inf where they are equal."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gap = np.minimum(smaller - larger, 0.0)
        result = np.where(gap > -math.log(2), np.log(-np.expm1(gap)), np.log1p(-np.exp(gap)))
    return np.asarray(np.where(larger == -np.inf, -np.inf, larger + result))


def _log_normal_mass(low: Array, high: Array) -> Array:
    """Return log(Phi(high) - Phi(low)), accurate in both tails."""
    # reflected so that the interval lies mostly in the lower tail, where Phi has full precision
    flip = low + high > 0
    below = np.where(flip, -high, low)
    above = np.where(flip, -low, high)
    return _log_difference(scipy.special.log_ndtr(above), scipy.special.log_ndtr(below))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class NormalDistribution(Distribution):
    """Normal in x or log x.

    Attributes
    ----------
    loc, scale : float
        Mean and standard deviation before the cut, of x or log x.
    """

    loc: float
    scale: float

    def from_normal(self, z: Any, low: Any = -math.inf, high: Any = math.inf) -> Array:
        """As of every law; of a whole one nothing but its scale counts."""
        if not self._cut_by(low, high):
            with np.errstate(over="ignore", under="ignore", invalid="ignore"):
                position = self.loc + self.scale * np.asarray(z, dtype=float)
                return np.asarray(np.exp(position) if self.log else position)
        return Distribution.from_normal(self, z, low, high)

    def to_normal(self, x: Any, low: Any = -np.inf, high: Any = np.inf) -> Array:
        """As `Distribution.to_normal`, for an uncut law without its bounds."""
        if not self._cut_by(low, high):
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                position = np.asarray(np.log(x) if self.log else x, dtype=float)
                return np.asarray((position - self.loc) / self.scale)
        return Distribution.to_normal(self, x, low, high)

    def _cut_by(self, low: Any, high: Any) -> bool:
        """Tell whether anything is cut away; bounds of many laws at once count as a cut."""
        end = 0.0 if self.log else -math.inf
        if not (isinstance(low, float) and isinstance(high, float)):
            return True
        return max(low, self.low) > end or min(high, self.high) < math.inf

    def _standard(self, position: Array) -> Array:
        # far bounds are infinite
        with np.errstate(over="ignore"):
            return np.asarray((position - self.loc) / self.scale)

    def _log_share(self, a: Array, b: Array) -> Array:
        return _log_normal_mass(self._standard(a), self._standard(b))

    def _position(self, z: Array, a: Array, b: Array) -> Array:
        whole, a, b, mass = self._cut_at(a, b)
        if not whole:
            mass = _log_normal_mass(a, b) if mass is None else mass
            lower = np.logaddexp(scipy.special.log_ndtr(a), scipy.special.log_ndtr(z) + mass)
            upper = np.logaddexp(scipy.special.log_ndtr(-b), scipy.special.log_ndtr(-z) + mass)
            z = np.where(
                lower < upper, scipy.special.ndtri_exp(lower), -scipy.special.ndtri_exp(upper)
            )
            z = np.minimum(np.maximum(z, a), b)
        return np.asarray(self.loc + self.scale * z)

    def _variate(self, position: Array, a: Array, b: Array) -> Array:
        standard = self._standard(position)
        whole, a, b, mass = self._cut_at(a, b)
        if whole:
            return standard
        mass = _log_normal_mass(a, b) if mass is None else mass
        sides = np.empty((2, 2, *np.broadcast_shapes(a.shape, b.shape, standard.shape)))
        sides[0, 0], sides[0, 1], sides[1, 0], sides[1, 1] = a, standard, standard, b
        lower, upper = np.minimum(_log_normal_mass(*sides) - mass, 0.0)
        return np.asarray(
            np.where(lower < upper, scipy.special.ndtri_exp(lower), -scipy.special.ndtri_exp(upper))
        )

    def _cut_at(self, a: Array, b: Array) -> tuple[bool, Array, Array, Array | None]:
        """Return whether nothing is cut away, standardised ends, and the log mass of one cut."""
        if a.ndim == b.ndim == 0:
            return _between(self, float(a), float(b))
        a, b = self._standard(a), self._standard(b)
        return _is_whole(a, b), a, b, None

    def _log_density(self, position: Array, a: Array, b: Array) -> Array:
        standard = self._standard(position)
        density = -0.5 * standard**2 - _HALF_LOG_2PI - math.log(self.scale)
        return density - _log_normal_mass(self._standard(a), self._standard(b))

    def _deviation(self, position: Array, a: Array, b: Array) -> Array:
        standard = np.abs(self._standard(position))
        least = np.abs(np.clip(0.0, self._standard(a), self._standard(b)))
        # the difference of two squares, without overflow
        return np.asarray(np.sqrt(np.maximum(standard - least, 0.0)) * np.sqrt(standard + least))

    @property
    def range_form(self) -> RangeForm:
        """Normal in r, or in log r."""
        if self.log:
            return RangeForm(-1.0, log_mean=self.loc, inverse_log_sd=1.0 / self.scale)
        return RangeForm(0.0, mean=self.loc, inverse_sd=1.0 / self.scale)


@functools.lru_cache(maxsize=256)
def _between(
    law: NormalDistribution, low: float, high: float
) -> tuple[bool, Array, Array, Array | None]:
    """Return whether nothing of a law is cut away, its standardised ends, and its log mass there.

    Found once: fits ask for them at every step.
    """
    a, b = law._standard(np.asarray(low)), law._standard(np.asarray(high))
    whole = _is_whole(a, b)
    return whole, a, b, None if whole else _log_normal_mass(a, b)


def _is_whole(a: Array, b: Array) -> bool:
    return bool(np.all(np.isneginf(a)) and np.all(np.isposinf(b)))


class Normal(Validated):
    """Normal law of given mean and standard deviation."""

    prior: Literal["normal"] = "normal"
    mean: Number
    sd: Positive

    def distribution(self) -> NormalDistribution:
        """Return the distribution."""
        return NormalDistribution(
            log=False, loc=self.mean, scale=self.sd, low=-math.inf, high=math.inf
        )


class HalfNormal(Validated):
    """Absolute value of a normal variate of mean 0; sd is that of the whole normal."""

    prior: Literal["halfnormal"] = "halfnormal"
    sd: Positive

    def distribution(self) -> NormalDistribution:
        """Return the distribution."""
        return NormalDistribution(log=False, loc=0.0, scale=self.sd, low=0.0, high=math.inf)


class LogNormal(Validated):
    """Law whose logarithm is normal with mean log(median) and standard deviation sigma."""

    prior: Literal["lognormal"] = "lognormal"
    median: Positive
    sigma: Annotated[Positive, pydantic.Field(le=100)]

    def distribution(self) -> NormalDistribution:
        """Return the distribution."""
        return NormalDistribution(
            log=True, loc=math.log(self.median), scale=self.sigma, low=0.0, high=math.inf
        )


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
        whole = NormalDistribution(
            log=False, loc=self.mean, scale=self.sd, low=-math.inf, high=math.inf
        )
        if not whole.log_mass(self.low, self.high) > LEAST_LOG_MASS:
            raise ValueError("the law has no mass between low and high that a number can hold")
        return self

    def distribution(self) -> NormalDistribution:
        """Return the distribution."""
        return NormalDistribution(
            log=False, loc=self.mean, scale=self.sd, low=self.low, high=self.high
        )
