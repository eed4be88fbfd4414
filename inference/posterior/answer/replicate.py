"""Readings replicated at draws of parameters and ranges."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.pieces import pieces
from inference.frame.arguments import Instrument, Rows, scene_of
from inference.frame.blocks import DISPLACEMENT, GAIN, RANGE, WARM
from inference.frame.known_range import rates_of
from inference.frame.mean_readings import with_surroundings
from inference.frame.noise import noise_of
from simulator.at_temperature import readings_at_reference
from simulator.compiled import compiled
from simulator.readings import object_readings
from simulator.terms import Terms

__all__ = ["replicate", "replicate_frames"]

Array = NDArray[np.float64]


@compiled
def _replicate(
    out: Array,
    normals: Array,
    rows: Rows,
    positions: Array,
    gains: Array,
    instrument: Instrument,
    errors: Array,
) -> None:
    """Fill out[i, j] with readings drawn at the log ranges positions[i, j]."""
    for i in range(positions.shape[0]):
        scene = scene_of(rows, instrument, i)
        shape, of = scene.shape, scene.instrument
        for j in range(positions.shape[1]):
            gain, r, signal = gains[j], math.inf, (0.0, 0.0)
            if math.isfinite(positions[i, j]):
                r = math.exp(positions[i, j])
                strength = gain * shape.strength * math.exp(errors[i, j])
                signal = object_readings(r, of.r0, of.wave, strength, shape.c0, shape.c1)
            mean = with_surroundings(signal, r, gain, scene)
            noise = noise_of(mean, signal, instrument)
            common = math.sqrt(noise.shared) * normals[i, j, 2]
            error = math.sqrt(noise.own1) * normals[i, j, 0]
            out[i, j, 0] = mean[0] + error + common + noise.common1 * normals[i, j, 3]
            error = math.sqrt(noise.own2) * normals[i, j, 1]
            out[i, j, 1] = mean[1] + error + common + noise.common2 * normals[i, j, 3]


def replicate(
    density: CollapsedDensity, z: Array, positions: Array, rng: np.random.Generator
) -> Array:
    """Draw readings anew at given parameters and log ranges.

    A smooth error of the object's flux is drawn anew, too, from its prior.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (n, d)
        Parameters.
    positions : ndarray, shape (n, frames)
        log r; nan for a frame without object.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (n, frames, 2)
        Readings.
    """
    out = np.empty((*positions.shape, 2))
    terms = density.parameters.terms(z)
    drawn = density.flux_errors(positions, rng)
    # an error of zero costs less than machine code of its own for what has none
    errors = np.zeros(positions.shape) if drawn is None else drawn
    normals = rng.standard_normal((*positions.shape, 4))
    for k, rows, data in pieces(density, terms, density.rows(terms)):
        gains = np.ascontiguousarray(data.frames[:, GAIN])
        _replicate(out[k], normals[k], rows, positions[k], gains, density.instrument, errors[k])
    return _at_temperature(density, terms, out)


def _at_temperature(density: CollapsedDensity, terms: Terms, readings: Array) -> Array:
    """Return readings at the sensor's reference temperature as they are at that of each frame."""
    if terms.drift is None or density.frames.shape[1] <= WARM:
        return readings
    warm = density.frames[:, WARM]
    static = np.zeros((len(readings), 2)) if terms.crosstalk is None else terms.crosstalk
    # back by the opposite drift, draw by draw: of none there is none
    moved = np.empty_like(readings)
    for i, (drift, x) in enumerate(zip(terms.drift[:, 1].tolist(), static, strict=True)):
        moved[i] = readings_at_reference(density.sensor, readings[i], warm, -drift, x)
    return moved


def replicate_frames(
    density: CollapsedDensity, z: Array, positions: Array, rng: np.random.Generator
) -> Array:
    """Draw frames anew: the readings, and what is known of ranges beside them.

    Parameters
    ----------
    density, z, positions, rng
        As of `replicate`.

    Returns
    -------
    ndarray, shape (n, frames, 3 or 7)
        As `CollapsedDensity.frames`.
    """
    out = np.repeat(density.frames[None], len(positions), axis=0)
    out[:, :, :GAIN] = replicate(density, z, positions, rng)
    rates = rates_of(density.frames)
    if rates is None:
        return out
    offset = density.parameters.terms(z).offset
    r = np.where(np.isfinite(positions), np.exp(positions), 0.0)
    means = r, r - (0.0 if offset is None else offset[:, None])
    for column, mean, rate in zip((RANGE, DISPLACEMENT), means, rates.T, strict=True):
        known = np.flatnonzero(rate > 0)
        noise = rng.standard_normal((len(out), known.size)) / rate[known]
        out[:, known, column] = mean[:, known] + noise
    return out
