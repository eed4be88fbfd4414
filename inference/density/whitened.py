"""Readings of all frames around given parameters and ranges, in units of their noise."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.frame.coordinates import coordinate_slopes
from inference.frame.known_range import Beside, beside, offset_slopes
from inference.frame.sensitivity import sensitivity, whiteners
from inference.frame.warmth import gains_of
from simulator.parameters import Parameters
from simulator.sensor import Sensor

__all__ = ["Whitened", "whitened"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Whitened:
    """Whitened residuals of n frames and how the mean readings change.

    Attributes
    ----------
    whitener : ndarray, shape (n, 2, 2)
        W with W^T W the inverse covariance of a frame's readings.
    residual : ndarray, shape (n, 2)
        W (y - m): standard normal variates at the true parameters and ranges.
    along : ndarray, shape (n, 2)
        W dm / d log r; zero for a frame without object.
    signal : ndarray, shape (n, 2)
        W times the object's part of m; zero for a frame without object.
    jacobian : ndarray, shape (n, 2, d)
        W dm / dz.
    beside : Beside or None
        The same of what is known of ranges beside the readings.
    by_offset : ndarray, shape (d,)
        Derivative of the offset of displacements along z [m].
    """

    whitener: Array
    residual: Array
    along: Array
    signal: Array
    jacobian: Array
    beside: Beside | None
    by_offset: Array

    @property
    def rows(self) -> tuple[Array, Array, Array]:
        """``residual``, ``along`` and ``jacobian`` with what is known beside the readings.

        Of shape (n, m), (n, m) and (n, m, d), m = 4 or, where nothing is known, 2.
        """
        if self.beside is None:
            return self.residual, self.along, self.jacobian
        residual, along, _ = self.beside
        return (
            np.concatenate([self.residual, residual], axis=1),
            np.concatenate([self.along, along], axis=1),
            np.concatenate([self.jacobian, self.beside_jacobian], axis=1),
        )

    @property
    def beside_jacobian(self) -> Array:
        """Derivatives along z of what would be known beside the readings, shape (n, 2, d)."""
        assert self.beside is not None  # noqa: S101  # asked where something is known
        return self.beside.by_offset[:, :, None] * self.by_offset

    @property
    def across(self) -> Array:
        """Unit normal to ``along``, turned to the left of it, shape (n, 2); zero with it."""
        length = np.linalg.norm(self.along, axis=1, keepdims=True)
        unit = np.divide(self.along, length, out=np.zeros_like(self.along), where=length > 0)
        return np.stack([-unit[:, 1], unit[:, 0]], axis=1)


def whitened(
    sensor: Sensor,
    parameters: Parameters,
    frames: Array,
    z: Array,
    log_r: Array,
    flux_error: tuple[Array, Array] | None = None,
) -> Whitened:
    """Linearise the readings at one parameter vector and given ranges.

    Parameters
    ----------
    frames : ndarray, shape (n, 3, 7 or 8)
        As `inference.density.collapsed.CollapsedDensity.frames`.
    z : ndarray, shape (d,)
        The parameters.
    log_r : ndarray, shape (n,)
        log r; nan for a frame without object.
    flux_error : (ndarray, ndarray), each of shape (n,), optional
        As for `inference.frame.sensitivity.sensitivity`.
    """
    terms, slopes = coordinate_slopes(parameters, z)
    at = sensitivity(sensor, terms, log_r, gains_of(frames), flux_error)
    whitener = whiteners(sensor, at)
    # a sum of products over an array that is not contiguous takes five times as long
    by_term = np.ascontiguousarray(at.by_term)
    return Whitened(
        whitener,
        np.einsum("nij,nj->ni", whitener, frames[:, :2] - at.mean),
        np.einsum("nij,nj->ni", whitener, at.by_range),
        np.einsum("nij,nj->ni", whitener, at.signal),
        np.einsum("nij,njt,td->nid", whitener, by_term, slopes),
        beside(frames, log_r, terms),
        offset_slopes(parameters, z),
    )
