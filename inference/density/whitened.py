"""Readings of all frames around given parameters and ranges, in units of their noise."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.sensitivity import sensitivity, term_changes, whiteners
from simulator.parameters import Parameters, Terms
from simulator.sensor import Sensor

__all__ = ["Whitened", "some_of", "whitened"]

Array = NDArray[np.float64]

# in z, whose prior has unit scale: the truncation error of a central difference is then 1e-10
_DIFFERENCE = 1e-5


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
    """

    whitener: Array
    residual: Array
    along: Array
    signal: Array
    jacobian: Array

    @property
    def across(self) -> Array:
        """Unit normal to ``along``, turned to the left of it, shape (n, 2); zero with it."""
        length = np.linalg.norm(self.along, axis=1, keepdims=True)
        unit = np.divide(self.along, length, out=np.zeros_like(self.along), where=length > 0)
        return np.stack([-unit[:, 1], unit[:, 0]], axis=1)


def some_of(terms: Terms, k: slice) -> Terms:
    """Return some of the parameter vectors of terms."""
    crosstalk = None if terms.crosstalk is None else terms.crosstalk[k]
    background = None if terms.background is None else terms.background[k]
    return Terms(terms.object[k], crosstalk, background, terms.ranges[k])


def whitened(
    sensor: Sensor, parameters: Parameters, frames: Array, z: Array, log_r: Array
) -> Whitened:
    """Linearise the readings at one parameter vector and given ranges.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    parameters : Parameters
        The unknowns.
    frames : ndarray, shape (n, 3)
        Two readings and the gain factor.
    z : ndarray, shape (d,)
        The parameters.
    log_r : ndarray, shape (n,)
        log r; nan for a frame without object.

    Returns
    -------
    Whitened
    """
    d = z.size
    steps = _DIFFERENCE * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    terms = parameters.terms(z + steps)
    centre = some_of(terms, slice(0, 1))
    plus, minus = some_of(terms, slice(1, d + 1)), some_of(terms, slice(d + 1, None))
    at = sensitivity(sensor, centre, log_r, np.ascontiguousarray(frames[:, 2]))
    change = term_changes(centre, plus, minus) / (2 * _DIFFERENCE)
    whitener = whiteners(sensor, at)
    return Whitened(
        whitener,
        np.einsum("nij,nj->ni", whitener, frames[:, :2] - at.mean),
        np.einsum("nij,nj->ni", whitener, at.by_range),
        np.einsum("nij,nj->ni", whitener, at.signal),
        np.einsum("nij,njt,td->nid", whitener, at.by_term, change),
    )
