"""A slow, obvious likelihood with a discrepancy: paths on a dense grid, ranges summed over it.

The Gaussian process, the physics and the integral are written anew; only what is told apart by
thousands of paths can be held to it, which is why the noise must be strong.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from simulator.sensor import PulsedSensor, Sensor

__all__ = ["PathSum", "matern_path_covariance", "sum_over_paths"]

Array = NDArray[np.float64]


def matern_path_covariance(u: Array, sd: float) -> Array:
    """Matern 5/2 covariance of unit length."""
    lag = math.sqrt(5) * np.abs(u[:, None] - u[None, :])
    return np.asarray(sd**2 * (1 + lag + lag**2 / 3) * np.exp(-lag))


@dataclasses.dataclass(frozen=True, eq=False)
class PathSum:
    """Likelihood of all frames and means of log r, each with its Monte Carlo standard error."""

    log_likelihood: float
    error: float
    mean_u: Array
    mean_u_error: Array


def _log_normal(residual: Array, sd: float) -> Array:
    return np.asarray(-0.5 * (residual / sd) ** 2 - math.log(sd) - 0.5 * math.log(2 * math.pi))


def sum_over_paths(
    sensor: Sensor,
    c: tuple[float, float, float],
    crosstalk: tuple[float, float],
    readings: Array,
    span: tuple[float, float],
    sd: float,
    paths: int,
    seed: int,
) -> PathSum:
    """Average the product of all frames' likelihoods over paths; log r uniform on its span."""
    rng = np.random.default_rng(seed)
    u = np.linspace(math.log(span[0]), math.log(span[1]), 241)
    values, vectors = np.linalg.eigh(matern_path_covariance(u, sd))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    delta = rng.standard_normal((paths, u.size)) @ root.T
    r = np.exp(u)
    c0, c1, c2 = c
    flux = sensor.known_gain * c0 * c2 / (r**2 * (r**2 + c1 * r + c0)) * np.exp(delta)
    if isinstance(sensor, PulsedSensor):
        first, second = flux * r / sensor.r0, flux
    else:
        phase = sensor.wave_number * r + sensor.known_phase_rad
        first, second = flux * np.cos(phase), flux * np.sin(phase)
    weight = np.full(u.size, 1 / (u.size - 1))
    weight[[0, -1]] /= 2
    total = np.zeros(paths)
    means = np.empty((paths, len(readings)))
    for j, (one, two) in enumerate(readings):
        density = _log_normal(one - first - crosstalk[0], sensor.noise.read[0])
        density = density + _log_normal(two - second - crosstalk[1], sensor.noise.read[1])
        density += np.log(weight)
        top = density.max(axis=1)
        mass = np.exp(density - top[:, None])
        whole = mass.sum(axis=1)
        total += top + np.log(whole)
        means[:, j] = (mass @ u) / whole
    share = np.exp(total - total.max())
    mean = share.mean()
    error = share.std() / math.sqrt(paths) / mean
    share = share / share.sum()
    mean_u = share @ means
    mean_error = np.sqrt((share**2) @ (means - mean_u) ** 2)
    return PathSum(float(total.max() + math.log(mean)), float(error), mean_u, mean_error)
