"""Laplace shapes in coordinates in which a thin sheet is straight, and how they follow draws.

A sheet that bends in the unknowns is climbed along a narrow valley, and its curvature at the top
says nothing of its ends. In coordinates in which it is straight the same posterior is nearly
normal: Newton's method comes to the top in a few steps. A smooth error of the model moves the top
away from the mean, so that the curvature there is a poor guess at the width. Draws tell it better:
log densities at some hundred draws are fitted by a quadratic function, weighted by importance
(Salimans and Knowles 2013, Fixed-form variational posterior approximation through stochastic linear
regression); where weights are many, by their own mean and covariance.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.coordinates import Coordinates
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.start import Optimum, curvature_factor, derivatives, lower_factor
from inference.posterior.sampling.transport import TriangularMap, unbent_map

__all__ = ["Shape", "followed", "shape_at"]

Array = NDArray[np.float64]

_STEP = 0.3  # standard deviations: the curvature of a wide stretch, not of the very top
_MOST_STEPS = 20  # of Newton's method
_LONGEST = 3.0  # standard deviations that one of them goes at most
_DONE = 0.1  # of them, and
_GAIN = 0.01  # nats, below which the top is reached
_SCALED = (0.2, 5.0)  # curvatures of a frame that fits
_TRIALS = np.array([2.0, 1.0, 0.5, 0.25, 0.1, 0.03])  # of a step
_STEEP = 30.0  # curvature along a column of the frame above which it is shortened first
_SHORTENINGS = 12
_NUMERIC = 1e-6  # of a standard deviation of the prior: step of the coordinates' own slopes

_BY_MOMENTS = 10  # times the unknowns: effective draws that tell a covariance themselves
_BY_TERMS = 2.0  # times the terms of a quadratic function: effective draws that it is fitted to
_HALF = 0.5  # of all draws, and no more
_FARTHER = 4.0  # standard deviations that a shape is moved at most
_LEAST_CURVATURE = 0.05  # below which a direction is widened, not fitted
_WIDER = 1.5  # times
_NOTHING = 1e-6  # of the largest weight: what is less is not fitted
_RIDGE = 1e-4  # of a scaled column: keeps terms apart that draws do not tell apart


@dataclasses.dataclass(frozen=True, eq=False)
class Shape:
    """A Laplace shape in straight coordinates.

    Attributes
    ----------
    optimum : Optimum
        The top, with the shape to first order in z.
    transport : TriangularMap
        That makes the shape a standard normal; it bends nothing but the coordinates.
    """

    optimum: Optimum
    transport: TriangularMap


@dataclasses.dataclass(frozen=True, eq=False)
class _Straight:
    """A density in other coordinates y."""

    density: CollapsedDensity
    coordinates: Coordinates

    def __call__(self, y: Array) -> Array:
        z = self.coordinates.backward(y)
        value = self.density(z) - self.coordinates.with_volume(z)[1]
        return np.where(np.isnan(value), -np.inf, value)


def shape_at(density: CollapsedDensity, coordinates: Coordinates, z: Array) -> Shape | None:
    """Climb to the top in straight coordinates, and measure the curvature around it.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    coordinates : FluxCoordinate, LightAtRest or Reparametrisation
        In which it is nearly normal.
    z : ndarray, shape (d,)
        Start, in the coordinates of the density.

    Returns
    -------
    Shape or None
        None where the density is not finite around the point.
    """
    target, _d = _Straight(density, coordinates), z.size
    y = coordinates.forward(z[None])[0]
    frame = _slopes(coordinates.forward, z) @ curvature_factor(density, z)
    best = -math.inf
    for _ in range(_MOST_STEPS):
        frame = _shortened(target, y, frame)
        best, gradient, hessian = derivatives(target, y, frame, _STEP)
        if not (np.isfinite(gradient).all() and np.isfinite(hessian).all()):
            frame = 0.5 * frame  # a bound of the support is near
            continue
        values, vectors = np.linalg.eigh(-hessian)
        slope = vectors.T @ gradient
        least = _LEAST_CURVATURE
        # a direction that does not bend downwards is climbed as if it bent somewhat
        step = slope / np.where(values > least, values, np.maximum(np.abs(values), _STEP))
        length = float(np.linalg.norm(step))
        step = vectors @ (step * min(1.0, _LONGEST / max(length, 1e-300)))
        trials = y + np.outer(_TRIALS, step) @ frame.T
        found = target(trials)
        k = int(np.argmax(found))
        gain = float(found[k]) - best
        if gain > 0:
            y, best = trials[k], float(found[k])
        bends = np.clip(values, 0.1, 1e4)
        frame = frame @ (vectors * np.where(values > 1e-3, 1.0 / np.sqrt(bends), _WIDER))
        fits = values[0] > _SCALED[0] and values[-1] < _SCALED[1]
        if fits and (length < _DONE or gain < _GAIN):
            break
    if not (np.isfinite(best) and np.isfinite(frame).all()):
        return None
    top = coordinates.backward(y[None])[0]
    spread = _slopes(coordinates.backward, y) @ frame
    factor = lower_factor(spread)
    if not (np.isfinite(factor).all() and np.diagonal(factor).all()):
        return None
    value = float(density(top[None])[0])
    return Shape(Optimum(top, value, factor), unbent_map(y, frame, coordinates))


def _slopes(function: Callable[[Array], Array], z: Array) -> Array:
    """Return the Jacobian of a change of coordinates, shape (d, d), by central differences."""
    d = z.size
    found = function(z + _NUMERIC * np.concatenate([np.eye(d), -np.eye(d)]))
    return np.asarray((found[:d] - found[d:]).T / (2.0 * _NUMERIC))


def _shortened(target: _Straight, y: Array, frame: Array) -> Array:
    """Shorten columns of a frame along which the density falls far within a step."""
    d = y.size
    steps = _STEP * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    for _ in range(_SHORTENINGS):
        value = target(y + steps @ frame.T)
        with np.errstate(invalid="ignore"):
            drop = value[0] - np.minimum(value[1 : d + 1], value[d + 1 :])
        bends = np.where(np.isfinite(drop), 2.0 * drop / _STEP**2, np.inf)
        steep = bends > _STEEP
        if not steep.any():
            break
        by = np.sqrt(3.0 / np.maximum(bends, 3.0))
        frame = frame * np.where(steep, np.maximum(by, 0.03), 1.0)
    return frame


def followed(transport: TriangularMap, pool: Pool, members: int) -> TriangularMap:
    """Return the shape that draws of shapes say that the target has.

    Parameters
    ----------
    transport : TriangularMap
        The shape so far.
    pool : Pool
        Draws of it and of those before.
    members : int
        The first of the pool's draws, which came from no shape.

    Returns
    -------
    TriangularMap
        The same where no draw has weight.
    """
    log_weights = pool.log_ratios[members:]
    some = np.isfinite(log_weights)
    if not some.any():
        return transport
    z, log_weights = pool.z[members:][some], log_weights[some]
    x, log_det = transport.unbend(z)
    weights = scipy.special.softmax(log_weights)
    d = z.shape[1]
    if 1.0 / np.sum(weights**2) >= _BY_MOMENTS * d:
        mean = weights @ x
        centred = np.sqrt(weights)[:, None] * (x - mean)
        factor = lower_factor(centred.T)
    else:
        terms = 1 + d + d * (d + 1) // 2
        weights = _flattened(log_weights, min(_BY_TERMS * terms, _HALF * len(x)))
        value = pool.target[members:][some] - log_det
        mean, factor = _quadratic(x, value, weights)
    if not (np.isfinite(factor).all() and np.isfinite(mean).all()):
        return transport
    return transport.moved(mean, factor)


def _flattened(log_weights: Array, least: float) -> Array:
    """Return weights to the largest power at which so many of them count."""

    def effective(power: float) -> float:
        return float(1.0 / np.sum(scipy.special.softmax(power * log_weights) ** 2))

    if effective(1.0) >= least:
        return np.asarray(scipy.special.softmax(log_weights))
    found = scipy.optimize.brentq(lambda power: effective(power) - least, 0.0, 1.0, xtol=1e-6)
    return np.asarray(scipy.special.softmax(float(found) * log_weights))


def _quadratic(x: Array, value: Array, weights: Array) -> tuple[Array, Array]:
    """Fit log densities by a quadratic function; return its top and its factor."""
    some = weights > _NOTHING * weights.max()
    x, value, root = x[some], value[some], np.sqrt(weights[some])
    d = x.shape[1]
    rows, columns = np.triu_indices(d)
    terms = np.column_stack([np.ones(len(x)), x, x[:, rows] * x[:, columns]])
    matrix = root[:, None] * terms
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    ridge = _RIDGE * np.eye(len(scale))
    ridge[0, 0] = 0.0
    right = np.concatenate([root * (value - value.max()), np.zeros(len(scale))])
    found = scipy.linalg.lstsq(np.concatenate([matrix / scale, ridge]), right)[0] / scale
    hessian = np.zeros((d, d))
    hessian[rows, columns] += found[d + 1 :]
    hessian[columns, rows] += found[d + 1 :]
    values, vectors = np.linalg.eigh(-hessian)
    slope = vectors.T @ found[1 : d + 1]
    bent = values > _LEAST_CURVATURE
    bends = np.maximum(values, _LEAST_CURVATURE)
    top = vectors @ np.where(bent, slope / bends, np.clip(slope, -1.0, 1.0))
    top = top * min(1.0, _FARTHER / max(float(np.linalg.norm(top)), 1e-300))
    return top, vectors * np.where(bent, 1.0 / np.sqrt(bends), _WIDER)
