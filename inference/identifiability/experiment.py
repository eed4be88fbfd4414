"""A set of frames at given ranges before a scene with given values: its information."""

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Background, RangePrior, prior_of
from inference.frame.coordinates import coordinate_slopes
from inference.frame.sensitivity import Sensitivity, sensitivity, whiteners
from inference.frame.shadow_error import ShadowError, shadow_at, with_shadow_error
from inference.identifiability.clock import as_ruled, by_clock, drifts
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information
from inference.identifiability.scaled_unknowns import ScaledUnknowns
from inference.identifiability.shared_errors import fewer
from simulator.discrepancy import discrepancy_basis
from simulator.parameters import OFFSET, Parameters, Terms
from simulator.sensor import Sensor

__all__ = ["Experiment", "information"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Experiment:
    """Frames at given ranges, and where in the space of the unknowns they are looked at.

    Attributes
    ----------
    parameters : Parameters
        The unknowns of the scene.
    z : ndarray, shape (d,)
        Their values, in the coordinates whose prior is standard normal.
    log_r : ndarray, shape (n,)
        log r of every frame [log m]; nan for a frame without object.
    gain : ndarray, shape (n,) or (n, 2), optional
        Factor of each frame on the sensor's gain, and by how much warmer than its reference the
        sensor was [K].
    known : tuple of str
        Unknowns that are supposed to be known after all.
    discrepancy : float, optional
        Standard deviation of a smooth error of the object's log flux along log r.
    common_range : bool
        Whether all frames have one unknown range: an object that is known not to move.
    shadow : float
        Standard deviation of the errors of a shadow (`inference.frame.shadow_error`); 0: none.
    error : ndarray, shape (k,), optional
        Coefficients of the flux's error, and then of the shadow's, that the readings have; left
        out: none.
    rates : ndarray, shape (n, 2), optional
        One over the standard deviations of what is known of range and displacement of each frame
        beside its readings [1/m], 0 where nothing is; left out: of no frame. Ranges are those of
        the effective distance (`inference.identifiability.clock.with_clock`).
    range_error : float
        Standard deviation of a smooth error of the effective distance along log r [m]; 0: none.
    """

    sensor: Sensor
    parameters: Parameters
    z: Array
    log_r: Array
    gain: Array | None = None
    known: tuple[str, ...] = ()
    discrepancy: float | None = None
    common_range: bool = False
    shadow: float = 0.0
    error: Array | None = None
    rates: Array | None = None
    range_error: float = 0.0

    @functools.cached_property
    def terms(self) -> Terms:
        """Physical values at z."""
        return self.parameters.terms(self.z[None])

    @property
    def shape(self) -> tuple[float, float]:
        """c0 [m^2] and c1 [m] of the object at z."""
        c0, c1, _ = self.terms.object[0].tolist()
        return c0, c1

    @property
    def background(self) -> Background | None:
        """The background at z."""
        rows = self.terms.background
        return None if rows is None else Background(*rows[0].tolist())

    @property
    def range_prior(self) -> RangePrior:
        """The prior of a range at z."""
        return prior_of(self.terms.ranges[0])

    @functools.cached_property
    def readings(self) -> Sensitivity:
        """Mean readings and their derivatives."""
        of = sensitivity(self.sensor, self.terms, self.log_r, self.gain, self._flux_error)
        if self._wall is None or self.error is None:
            return of
        return with_shadow_error(of, self._wall, self.error[self.flux_errors :])

    @functools.cached_property
    def _wall(self) -> ShadowError | None:
        """The background as errors of its shadow act on it; None where there are none."""
        if not self.shadow > 0:
            return None
        reach = self.parameters.reach_m
        return shadow_at(self.sensor, self.terms, self.log_r, self.gain, reach, self.shadow)

    @property
    def flux_errors(self) -> int:
        """How many coefficients the flux's error has."""
        return 0 if self.discrepancy is None else discrepancy_basis(*self.parameters.reach_m).size

    @property
    def _flux_error(self) -> tuple[Array, Array] | None:
        """Logarithm of the factor on the object's flux, and its slope along log r."""
        if self.discrepancy is None or self.error is None:
            return None
        basis = discrepancy_basis(*self.parameters.reach_m)
        present = np.isfinite(self.log_r)
        at, size = np.where(present, self.log_r, basis.first), self.discrepancy * present
        error = self.error[: basis.size]
        return size * (basis.values(at) @ error), size * (basis.slopes(at) @ error)

    @property
    def names(self) -> tuple[str, ...]:
        """Unknowns on which the readings depend: all but those of the ranges' prior."""
        names = self.parameters.names
        return tuple(n for n in names if not n.startswith("range_m.") and n not in self.known)

    @functools.cached_property
    def unknowns(self) -> ScaledUnknowns:
        """The unknowns of ``names``, in units of this scene."""
        crosstalk = self.terms.crosstalk
        light = None if crosstalk is None else np.abs(self.readings.mean - crosstalk[0])
        return ScaledUnknowns(
            self.sensor, self.parameters, self.z, self.terms, self.names, self.typical_m, light
        )

    @functools.cached_property
    def finite(self) -> bool:
        """Whether readings, noise and derivatives are numbers that can be computed with."""
        by_term, along, by_error = self.whitened()
        along = along[np.isfinite(self.log_r)]
        units = self.unknowns.in_si_units
        with np.errstate(over="ignore"):
            # sums of squares of all of them must not overflow either
            sizes = [float(np.square(part).sum()) for part in (by_term, along, by_error, units)]
            sizes.append(float(np.square(self.change).sum()))
        return bool(np.isfinite(sizes).all() and np.isfinite(self.z).all())

    @functools.cached_property
    def change(self) -> Array:
        """Derivatives of the coordinates of `COORDINATES` along z, shape (9, 11 or 13, d)."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
            return coordinate_slopes(self.parameters, self.z)[1]

    @functools.cached_property
    def by_error(self) -> Array:
        """Derivatives of the readings along the coefficients of the errors.

        Of flux and shadow, and where anything is known of ranges beside the readings of the
        effective distance, shape (n, 2, k). The coefficients are independent and standard normal.
        """
        parts = [self._by_flux_error]
        if self._wall is not None:
            parts.append(self._wall.columns)
        if self.range_error > 0 and self.rates is not None:
            of = self.sensor, self.readings.signal, self.log_r, self.parameters.reach_m
            parts.append(by_clock(*of, self.range_error))
        return np.concatenate(parts, axis=2)

    def drifts(self, share: Array | None = None) -> Array | None:
        """Return how ranges follow an error of the effective distance that nothing tells of.

        Parameters
        ----------
        share : ndarray, shape (n,), optional
            Of the information on log r what is the readings'; left out: all.

        Returns
        -------
        ndarray, shape (n, k), or None
            Of log r; None without an error, and where ``by_error`` has it.
        """
        if not self.range_error > 0 or self.rates is not None:
            return None
        share = np.ones(self.log_r.size) if share is None else share
        return drifts(self.log_r, self.parameters.reach_m, self.range_error, share)

    @property
    def _by_flux_error(self) -> Array:
        n = self.log_r.size
        if self.discrepancy is None:
            return np.empty((n, 2, 0))
        basis = discrepancy_basis(*self.parameters.reach_m)
        present = np.isfinite(self.log_r)
        derivatives = np.zeros((n, 2, basis.size))
        functions = self.discrepancy * basis.values(self.log_r[present])
        derivatives[present] = self.readings.signal[present][:, :, None] * functions[:, None, :]
        return derivatives

    def whitened_terms(self, whitener: Array | None = None) -> tuple[Array, Array, Array]:
        """Return whitened derivatives of the readings along all that they depend on.

        Parameters
        ----------
        whitener : ndarray, shape (n, 2, 2), optional
            W with W^T W the inverse covariance of a frame's readings; left out: the sensor's.

        Returns
        -------
        ndarray, shape (n, 2, 9, 11 or 13)
            Along `COORDINATES`, and the sensor's where something of it is unknown.
        ndarray, shape (n, 2)
            Along log r; nan for a frame without object.
        ndarray, shape (n, 2, k)
            Along the coefficients of the errors, as ``by_error``.
        """
        return self._whitened_by_noise if whitener is None else self._whitened_terms(whitener)

    @functools.cached_property
    def _whitened_by_noise(self) -> tuple[Array, Array, Array]:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
            parts = self._whitened_terms(whiteners(self.sensor, self.readings))
        for part in parts:
            part.flags.writeable = False
        return parts

    def _whitened_terms(self, whitener: Array) -> tuple[Array, Array, Array]:
        of = self.readings
        with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
            by_term = np.einsum("nij,njk->nik", whitener, of.by_term)
            along = np.einsum("nij,nj->ni", whitener, of.by_range)
            along[np.isnan(self.log_r)] = np.nan
            by_error = np.einsum("nij,njk->nik", whitener, self.by_error)
        return by_term, along, by_error

    @property
    def told(self) -> Array:
        """Range and displacement of every frame at z [m], shape (n, 2); 0 without an object."""
        r = np.where(np.isfinite(self.log_r), np.exp(self.log_r), 0.0)
        offset = self.terms.offset
        return np.stack([r, r if offset is None else r - offset[0]], axis=1)

    @property
    def beside(self) -> tuple[Array, Array] | None:
        """Derivatives of what is known beside the readings, in units of its noise.

        Along log r, shape (n, 2), and along ``names``, shape (n, 2, d).
        """
        if self.rates is None:
            return None
        along = self.told[:, :1] * self.rates
        by_name = np.zeros((*along.shape, len(self.names)))
        if OFFSET in self.names:
            by_name[:, 1, self.names.index(OFFSET)] = -self.typical_m * self.rates[:, 1]
        return along, by_name

    @property
    def typical_m(self) -> float:
        """A typical range [m], by which the offset of displacements is measured."""
        present = np.isfinite(self.log_r)
        return float(np.exp(self.log_r[present].mean())) if present.any() else 1.0

    def whitened(self, whitener: Array | None = None) -> tuple[Array, Array, Array]:
        """Return the same with the first along ``names``, shape (n, 2, d)."""
        by_term, along, by_error = self.whitened_terms(whitener)
        with np.errstate(over="ignore", invalid="ignore"):
            return by_term @ self.unknowns.directions, along, by_error


def information(experiment: Experiment, quieter: float = 1.0) -> Information:
    """Return what the readings alone tell of the unknowns, without any prior.

    Parameters
    ----------
    experiment : Experiment
        Sensor, unknowns, their values, ranges.
    quieter : float
        By how many times the noise of the readings would be lower.

    Returns
    -------
    Information
        In the dimensionless coordinates of `ScaledUnknowns.directions`.
    """
    by_name, along, by_error = (quieter * part for part in experiment.whitened())
    of = eliminate(
        experiment.names,
        by_name,
        along,
        fewer(by_error),
        common_range=experiment.common_range,
        beside=experiment.beside,
    )
    share, own = as_ruled(experiment.rates, experiment.log_r, experiment.range_error)
    return dataclasses.replace(
        of,
        response=of.response * share[:, None],
        own_variance=of.own_variance * share**2 + own,
        error_response=of.error_response * share[:, None],
        drifts=experiment.drifts(),
    )
