"""What every prior of the scene language is able to do, and what one offers as prior of the ranges.

An unknown is sampled in the coordinate z in which its prior is the standard normal: unbounded, near
unit scale whatever the units, and the posterior's spread in z is its contraction against the prior.
"""

import abc
import dataclasses
import functools
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_LOG_MASS", "Distribution", "RangeForm"]

Array = NDArray[np.float64]

LEAST_LOG_MASS = -700.0  # of a law inside its support: a share of 1e-304, below are no numbers


class RangeForm(NamedTuple):
    """A prior density of a range r as the kernels hold it, up to its normalisation.

    log p(r) = power log r - ((r - mean) inverse_sd)^2 / 2
    - ((log r - log_mean) inverse_log_sd)^2 / 2; see `simulator.range_prior`, which normalises it.

    Attributes
    ----------
    power : float
        0 of a density in r, -1 of one in log r; nothing else is normalised.
    mean, inverse_sd, log_mean, inverse_log_sd : float
        Of a normal in r, or in log r, never both [m], [1/m], log of m, 1.
    """

    power: float
    mean: float = 0.0
    inverse_sd: float = 0.0
    log_mean: float = 0.0
    inverse_log_sd: float = 0.0


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Distribution(abc.ABC):
    """A law of x, or of log x, cut to the support [low, high].

    A form of law says five things in its own coordinate (x or log x), between bounds a < b of it:
    `_log_share`, `_position`, `_variate`, `_log_density` and `_deviation`; and what it offers as
    prior of the ranges, `range_form`.

    Attributes
    ----------
    log : bool
        Whether the law is that of log x.
    low, high : float
        Support in x.
    """

    log: bool
    low: float
    high: float

    @abc.abstractmethod
    def _log_share(self, a: Array, b: Array) -> Array:
        """Log of the mass between a and b, up to a constant of the law."""

    @abc.abstractmethod
    def _position(self, z: Array, a: Array, b: Array) -> Array:
        """Map standard normal variates to the law between a and b."""

    @abc.abstractmethod
    def _variate(self, position: Array, a: Array, b: Array) -> Array:
        """Inverse of `_position`."""

    @abc.abstractmethod
    def _log_density(self, position: Array, a: Array, b: Array) -> Array:
        """Log density at a position of the law between a and b."""

    @abc.abstractmethod
    def _deviation(self, position: Array, a: Array, b: Array) -> Array:
        """Root of twice by how much the log density is below its greatest between a and b."""

    @property
    @abc.abstractmethod
    def range_form(self) -> RangeForm | None:
        """What the law is as prior of the ranges; None where it cannot be one."""

    def _coordinate(self, x: Any) -> Array:
        # below zero a law of log x has no density: nan, which every comparison refuses
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log(x) if self.log else x, dtype=float)

    def _bounds(self, low: Any, high: Any) -> tuple[Array, Array]:
        """Bounds in the law's own coordinate, those of the support included."""
        a = self._coordinate(np.maximum(low, self.low))
        b = self._coordinate(np.minimum(high, self.high))
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
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            mass = self._log_share(a, b) - self._log_share(*self._bounds(self.low, self.high))
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
        if isinstance(low, float) and isinstance(high, float):
            a, b = _ends(self, low, high)
            least: Any = max(low, self.low)
            most: Any = min(high, self.high)
        else:
            low = np.maximum(low, 0.0) if self.log else low
            a, b = self._bounds(low, high)
            least, most = np.maximum(low, self.low), np.minimum(high, self.high)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            position = self._position(z, a, b)
            x = np.exp(position) if self.log else position
        # exp(log(x)) may leave the support by a rounding, where the density is zero
        return np.asarray(np.minimum(np.maximum(x, least), most))

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
        position = self._coordinate(x)
        if isinstance(low, float) and isinstance(high, float):
            a, b = _ends(self, low, high)
        else:
            a, b = self._bounds(np.maximum(low, 0.0) if self.log else low, high)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(self._variate(position, a, b))

    def log_density(self, x: Any) -> Array:
        """Log density of x [1 / unit of x], -inf outside the support."""
        x = np.asarray(x, dtype=float)
        position = self._coordinate(x)
        a, b = self._bounds(self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            density = self._log_density(position, a, b)
            if self.log:
                density = density - position
        # a law of log x has no density at x = 0, where both of its terms are infinite
        inside = (x >= self.low) & (x <= self.high) & ~np.isnan(density)
        return np.asarray(np.where(inside, density, -np.inf))

    def deviation(self, x: Any, low: Any = -np.inf, high: Any = np.inf) -> Array:
        """Return how far x lies from where the law, cut to [low, high], is densest.

        Of a whole normal law |z|. A law that is densest at its end, as a half normal one is at
        zero, has next to no mass there and yet nothing against it.

        Parameters
        ----------
        x, low, high : array_like
            As for `to_normal`.

        Returns
        -------
        ndarray
            ``sqrt(2 log(p_max / p))``, p the density in the law's own coordinate (x or log x).
        """
        low = np.maximum(low, 0.0) if self.log else low
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(self._deviation(self._coordinate(x), *self._bounds(low, high)))

    def truncated(self, low: float = -np.inf, high: float = np.inf) -> Self:
        """Return the same law on a smaller support, renormalised."""
        return dataclasses.replace(self, low=max(low, self.low), high=min(high, self.high))


@functools.lru_cache(maxsize=256)
def _ends(law: Distribution, low: float, high: float) -> tuple[Array, Array]:
    """Return bounds in the coordinate of a law, found once: fits ask for them at every step."""
    return law._bounds(np.maximum(low, 0.0) if law.log else low, high)
