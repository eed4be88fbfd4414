"""What smooth errors of the shadow on a background do to readings (docs/model.md, shadow-error).

Light b S of a background of which the share S is visible errs by sqrt(S) (1 - S) b phi, and what
makes it later by S (1 - S) R phi for the distance R, phi smooth functions of log r of unit size.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, instrument_of
from inference.frame.delayed import delayed
from inference.frame.sensitivity import Sensitivity, Value
from inference.frame.warmth import circuits
from simulator.discrepancy import DiscrepancyBasis, discrepancy_basis
from simulator.object_arrays import quadratics
from simulator.parameters import Terms
from simulator.readings import late_share
from simulator.sensor import Sensor
from simulator.sensor_unknowns import sensor_at
from simulator.shadow_error import shadow_errors

__all__ = ["ShadowError", "shadow_at", "shadow_basis", "shadow_error", "with_shadow_error"]

Array = NDArray[np.float64]

_NEGLECTED = 1e-2  # of the variance: a tenth of the error's size, itself known to a fifth


def shadow_basis(low: float, high: float) -> DiscrepancyBasis:
    """Return the functions of a shadow's errors for ranges between two bounds [m]."""
    return discrepancy_basis(low, high, _NEGLECTED)


@dataclasses.dataclass(frozen=True, eq=False)
class ShadowError:
    """A background behind an object at given ranges, as errors of its shadow act on it.

    Attributes
    ----------
    values : ndarray, shape (9,)
        Physical values in the order of `Value`.
    bare, late : ndarray, shape (n, 2)
        Readings of the background with nothing before it, and their relative change with its
        distance.
    later : ndarray, shape (n, 2)
        Derivative of ``late`` along the distance.
    log_r : ndarray, shape (n,)
        nan without an object.
    share : ndarray, shape (n,)
        S; 1 without an object.
    basis : DiscrepancyBasis
        phi.
    size : float
        Standard deviation of both errors.
    """

    values: Array
    bare: Array
    late: Array
    later: Array
    log_r: Array
    share: Array
    basis: DiscrepancyBasis
    size: float

    def _weights(self) -> tuple[Array, Array]:
        """Return sqrt(S) (1 - S) and S (1 - S), shape (n, 1)."""
        light, distance = shadow_errors(self.share)
        seen = np.maximum(self.share, 0.0)
        return (seen * light)[:, None], (seen * distance)[:, None]

    @property
    def columns(self) -> Array:
        """Derivatives along independent standard normal errors, shape (n, 2, 2 functions).

        Of the light, and then of the distance.
        """
        phi = self.size * self.basis.values(np.where(np.isnan(self.log_r), 0.0, self.log_r))
        of_light, of_distance = self._weights()
        parts = self.bare * of_light, self.late * of_distance
        return np.concatenate([part[:, :, None] * phi[:, None, :] for part in parts], axis=2)

    def changes(self, a: Array) -> tuple[Array, Array]:
        """Return what the errors do to derivatives of the readings.

        Parameters
        ----------
        a : ndarray, shape (2 functions,)
            The errors.

        Returns
        -------
        (ndarray, ndarray)
            Of those along all of ``values``, shape (n, 2, 9), and along log r, shape (n, 2).
        """
        present = np.isfinite(self.log_r)
        u = np.where(present, self.log_r, 0.0)
        halves = self.size * np.stack(np.split(a, 2), axis=1)
        phi, steep = self.basis.values(u) @ halves, self.basis.slopes(u) @ halves
        of_light, of_distance = self._weights()
        at = self.values
        moved = self.bare * of_light * phi[:, :1] + self.late * of_distance * phi[:, 1:]
        by_value = np.zeros((*moved.shape, at.size))
        by_value[:, :, Value.STRENGTH] = moved / at[Value.STRENGTH]
        by_value[:, :, Value.DISTANCE] = (
            self.late / at[Value.DISTANCE] * of_light * phi[:, :1]
            + self.later * of_distance * phi[:, 1:]
        )
        seen = np.where(self.share > 0.0, self.share, 1.0)
        root = np.sqrt(seen)[:, None]
        by_share = self.bare * (0.5 / root - 1.5 * root) * phi[:, :1]
        by_share += self.late * (1.0 - 2.0 * root * root) * phi[:, 1:]
        by_share[~(present & (self.share > 0.0))] = 0.0
        c0, c1 = at[Value.SHADOW_C0], at[Value.SHADOW_C1]
        r = np.exp(u)
        q = quadratics(r, c0, c1)
        by_value[:, :, Value.SHADOW_C0] = by_share * (-r * (r + c1) / q / q)[:, None]
        by_value[:, :, Value.SHADOW_C1] = by_share * (r * c0 / q / q)[:, None]
        along = by_share * (r * c0 * (2.0 * r + c1) / q / q)[:, None]
        along += self.bare * of_light * steep[:, :1] + self.late * of_distance * steep[:, 1:]
        return by_value, along


def shadow_error(
    values: Array,
    log_r: Array,
    factors: Array,
    instrument: Instrument,
    reach_m: tuple[float, float],
    size: float,
) -> ShadowError:
    """Put a background behind an object.

    Parameters
    ----------
    values : ndarray, shape (at least 9,)
        Physical values in the order of `Value`.
    log_r : ndarray, shape (n,)
        nan without an object.
    factors : ndarray, shape (n,)
        Of every frame on the gain.
    instrument : Instrument
        The sensor.
    reach_m : (float, float)
        Ranges that the scene allows [m].
    size : float
        Standard deviation of both errors, in units of `simulator.shadow_error.shadow_errors`.
    """
    at = np.array(values[: Value.LOG_RANGE])
    strength, distance = float(at[Value.STRENGTH]), float(at[Value.DISTANCE])
    c0, c1 = float(at[Value.SHADOW_C0]), float(at[Value.SHADOW_C1])
    r0, wave = instrument.r0, instrument.wave
    if wave is None:
        bare = strength * np.array([late_share(distance, r0), 1.0])
    else:
        phase = wave[0] * distance + wave[1]
        bare = strength * np.array([math.cos(phase), math.sin(phase)])
    behind = np.array([math.log(distance)])
    once = delayed(bare[None], behind, r0, wave)
    later = once + distance * delayed(once, behind, r0, wave)
    present = np.isfinite(log_r)
    r = np.exp(np.where(present, log_r, 0.0))
    share = np.where(present, r * (r + c1) / quadratics(r, c0, c1), 1.0)
    gains = factors[:, None]
    return ShadowError(
        at,
        gains * bare,
        gains * distance * once,
        gains * later,
        log_r,
        share,
        shadow_basis(*reach_m),
        size,
    )


def shadow_at(
    sensor: Sensor,
    terms: Terms,
    log_r: Array,
    gain: Array | None,
    reach_m: tuple[float, float],
    size: float,
) -> ShadowError:
    """Put the background of a scene behind an object.

    Parameters
    ----------
    sensor, terms, log_r, gain
        As for `inference.frame.sensitivity.sensitivity`; what a delay drifts by is left out.
    reach_m, size
        As for `shadow_error`.
    """
    assert terms.background is not None  # noqa: S101  # what has a size has a background
    sensor = sensor_at(sensor, terms)
    factors, warm = circuits(log_r.size, gain)
    if terms.drift is not None:
        factors = factors * (1.0 + terms.drift[0, 0] * warm)
    values = np.zeros(Value.LOG_RANGE)
    values[Value.STRENGTH :] = terms.background[0]
    return shadow_error(values, log_r, factors, instrument_of(sensor), reach_m, size)


def with_shadow_error(of: Sensitivity, shadow: ShadowError, a: Array) -> Sensitivity:
    """Return readings and derivatives with given errors of the shadow, shape (2 functions,)."""
    by_value, along = shadow.changes(a)
    scales = shadow.values.copy()
    scales[Value.SHADOW_C1] = math.sqrt(scales[Value.SHADOW_C0])
    by_term = of.by_term.copy()
    by_term[:, :, : Value.LOG_RANGE] += by_value * scales
    mean = of.mean + shadow.columns @ a
    return dataclasses.replace(of, mean=mean, by_term=by_term, by_range=of.by_range + along)
