"""The noise of a frame's two readings: one covariance, one whitener.

Kernels take the noise as independent parts, from which nothing cancels
(`simulator.readings.noise_parts`); covariance, its determinant, the whitener W with W^T W its
inverse and the root L with L L^T itself follow from them. The determinant is a sum of squares: a
common relative error far above the read noise leaves the matrix near singular, but its determinant
exact. Array forms are the kernels over all frames.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, Pair
from simulator.compiled import compiled
from simulator.readings import light_that_errs, noise_parts

__all__ = [
    "NoiseParts",
    "Triangle",
    "covariance",
    "covariances",
    "determinant",
    "has_shot",
    "in_units",
    "noise_of",
    "root",
    "whitener",
    "whiteners",
]

Array = NDArray[np.float64]


class NoiseParts(NamedTuple):
    """Independent parts of two readings' noise: diag(own) + shared [1 1; 1 1] + common common^T.

    Attributes
    ----------
    own1, own2 : float
        Variance of each reading's own noise [reading units^2].
    shared : float
        Variance of what both have in common: the late photons of a pulse.
    common1, common2 : float
        Standard deviation of the common relative error in each reading [reading units].
    """

    own1: float
    own2: float
    shared: float
    common1: float
    common2: float


class Triangle(NamedTuple):
    """A symmetric or lower triangular matrix of two rows: elements 11, 21 and 22."""

    e11: float
    e21: float
    e22: float


@compiled
def has_shot(shot: float | None) -> bool:
    """Tell whether the variance grows with the light: there are kinks where a mean vanishes."""
    if shot is not None:
        return shot > 0.0
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return False


@compiled
def noise_of(mean: Pair, signal: Pair, instrument: Instrument) -> NoiseParts:
    """Return the noise at mean readings, of which ``signal`` is the object's part."""
    own1, own2, shared, common1, common2 = noise_parts(
        instrument.read,
        instrument.shot,
        instrument.relative,
        instrument.wave is None,
        mean,
        light_that_errs(mean, signal, instrument.of_source),
    )
    return NoiseParts(own1, own2, shared, common1, common2)


@compiled
def in_units(noise: NoiseParts, unit: float) -> NoiseParts:
    """Return the noise of readings in units of ``unit``: of read noise, nothing overflows."""
    return NoiseParts(
        noise.own1 / unit / unit,
        noise.own2 / unit / unit,
        noise.shared / unit / unit,
        noise.common1 / unit,
        noise.common2 / unit,
    )


@compiled
def determinant(noise: NoiseParts) -> float:
    """Return the determinant of the covariance, a sum of squares."""
    own1, own2, shared, s1, s2 = noise
    return (
        own1 * own2
        + shared * (own1 + own2)
        + own2 * s1 * s1
        + own1 * s2 * s2
        + shared * ((s1 - s2) * (s1 - s2))
    )


@compiled
def covariance(noise: NoiseParts) -> Triangle:
    """Return the covariance of two readings."""
    own1, own2, shared, s1, s2 = noise
    return Triangle(own1 + shared + s1 * s1, shared + s1 * s2, own2 + shared + s2 * s2)


@compiled
def whitener(noise: NoiseParts) -> Triangle:
    """Return lower triangular W with W^T W the inverse covariance: W e has unit covariance."""
    matrix = covariance(noise)
    length, area = math.sqrt(matrix.e11), math.sqrt(determinant(noise))
    return Triangle(1.0 / length, -matrix.e21 / length / area, length / area)


@compiled
def root(noise: NoiseParts) -> Triangle:
    """Return lower triangular L with L L^T the covariance, the inverse of `whitener`."""
    matrix = covariance(noise)
    length = math.sqrt(matrix.e11)
    return Triangle(length, matrix.e21 / length, math.sqrt(determinant(noise)) / length)


@compiled
def _fill(
    out: Array, means: Array, signals: Array, instrument: Instrument, whitening: bool
) -> None:
    """Fill out[j] with the covariance, or the whitener, of frame j."""
    unit = instrument.read[1]
    for j in range(means.shape[0]):
        mean, signal = (means[j, 0], means[j, 1]), (signals[j, 0], signals[j, 1])
        noise = noise_of(mean, signal, instrument)
        if whitening:
            found = whitener(in_units(noise, unit))
            out[j, 0, 0], out[j, 0, 1] = found.e11 / unit, 0.0
            out[j, 1, 0], out[j, 1, 1] = found.e21 / unit, found.e22 / unit
        else:
            found = covariance(noise)
            out[j, 0, 0], out[j, 0, 1] = found.e11, found.e21
            out[j, 1, 0], out[j, 1, 1] = found.e21, found.e22


def covariances(instrument: Instrument, means: Array, signals: Array) -> Array:
    """Return the covariance of every frame's readings.

    Parameters
    ----------
    instrument : Instrument
        Its noise.
    means : ndarray, shape (n, 2)
        Mean readings, everything included; readings as measured where their means are not known.
    signals : ndarray, shape (n, 2)
        The object's part of them, to which the relative error belongs where it is not the source's.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        [reading units^2].
    """
    return _of_all(instrument, means, signals, False)


def whiteners(instrument: Instrument, means: Array, signals: Array) -> Array:
    """Return W with W^T W the inverse covariance of every frame's readings.

    Parameters
    ----------
    instrument, means, signals
        As for `covariances`.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lower triangular [1 / reading units].
    """
    return _of_all(instrument, means, signals, True)


def _of_all(instrument: Instrument, means: Array, signals: Array, whitening: bool) -> Array:
    out = np.empty((len(means), 2, 2))
    # sizes of zero rather than None: the machine code is one, and here costs nothing
    whole = instrument._replace(shot=instrument.shot or 0.0, relative=instrument.relative or 0.0)
    _fill(out, np.ascontiguousarray(means), np.ascontiguousarray(signals), whole, whitening)
    return out
