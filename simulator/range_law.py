"""The law of the ranges: stated or by default, cut by sensor and background, normalised."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.priors import Distribution, LogNormal, Uniform
from simulator.scene import Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor
from simulator.unknowns import Unknown, Values

__all__ = ["RangePrior", "range_laws", "range_prior", "stroke_unknowns"]

Array = NDArray[np.float64]
RangePrior = Distribution | Stroke | Reference

_DEFAULT_RANGE = (0.02, 20.0)
_STROKE_SPREAD = LogNormal(median=0.5, sigma=1.0).distribution()


def range_prior(sensor: Sensor, scene: Scene) -> RangePrior:
    """Return the prior of the ranges, cut to what the sensor reaches and a known background."""
    limit = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
    if scene.background is not None and isinstance(scene.background.distance_m, float | int):
        limit = min(limit, scene.background.distance_m)
    if scene.range_m is None:
        high = min(sensor.max_range_m, _DEFAULT_RANGE[1], limit)
        # a sensor that sees less than 2 cm still has ranges
        low = _DEFAULT_RANGE[0] if high > _DEFAULT_RANGE[0] else high / 100
        # not a `LogUniform`: sizes are asked of what is stated, not of what follows from it
        return Distribution("uniform", True, 0.0, 1.0, low, high)
    if isinstance(scene.range_m, Stroke | Reference):
        return type(scene.range_m)(low=scene.range_m.low, high=min(scene.range_m.high, limit))
    return scene.range_m.distribution().truncated(0.0, limit)


def stroke_unknowns(prior: Stroke) -> tuple[Unknown, Unknown]:
    """Return centre and spread of log-normal ranges."""
    law = Uniform(low=math.log(prior.low), high=math.log(prior.high)).distribution()
    return (
        Unknown(
            "range_m.centre",
            lambda z, _: np.exp(law.from_normal(z)),
            lambda x, _: law.to_normal(np.log(x)),
        ),
        Unknown(
            "range_m.spread",
            lambda z, _: _STROKE_SPREAD.from_normal(z),
            lambda x, _: _STROKE_SPREAD.to_normal(x),
        ),
    )


def range_laws(prior: RangePrior, values: Values, background: Array | None, n: int) -> Array:
    """Return the laws of the ranges given n parameter vectors.

    Parameters
    ----------
    prior : Distribution, Stroke or Reference
        From `range_prior`.
    values : dict of str to ndarray, shape (n,)
        Of the unknowns.
    background : ndarray, shape (n, 4), optional
        As in `simulator.parameters.Terms`.
    n : int
        Number of vectors.

    Returns
    -------
    ndarray, shape (n, 8)
        As in `simulator.parameters.Terms`.
    """
    law = np.zeros((n, 8))
    if isinstance(prior, Stroke):
        law[:, 1] = -1.0
        law[:, 4] = np.log(values["range_m.centre"])
        with np.errstate(divide="ignore", over="ignore"):  # far out in z a spread underflows
            law[:, 5] = 1.0 / values["range_m.spread"]
        law[:, 6], law[:, 7] = prior.low, prior.high
    elif isinstance(prior, Reference):
        law[:, 1] = -1.0
        law[:, 6], law[:, 7] = prior.low, prior.high
    else:
        law[:, 1] = -1.0 if prior.log else 0.0
        if prior.base == "normal":
            law[:, 4 if prior.log else 2] = prior.loc
            law[:, 5 if prior.log else 3] = 1.0 / prior.scale
        law[:, 6], law[:, 7] = prior.low, prior.high
    if background is not None:
        # a shadow with c1' < 0 is negative below r = -c1': such ranges are not physical
        law[:, 6] = np.maximum(law[:, 6], -background[:, 3])
        # and an object stands before its background: else a frame whose object is dark could
        # lie anywhere behind it, where nothing contradicts, and draw the other unknowns along
        law[:, 7] = np.minimum(law[:, 7], background[:, 1])
    law[:, 0] = -_log_normaliser(prior, law)
    return law


def _log_normaliser(prior: RangePrior, law: Array) -> Array:
    """Log integral of the unnormalised law over its support, shape (n,)."""
    low, high = law[:, 6], law[:, 7]
    if isinstance(prior, Reference):  # a density per distinguishable range
        return np.where(high > low, 0.0, np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if isinstance(prior, Stroke) or prior.base == "normal":
            in_log = isinstance(prior, Stroke) or prior.log
            loc, inverse = (law[:, 4], law[:, 5]) if in_log else (law[:, 2], law[:, 3])
            unit = Distribution("normal", False, 0.0, 1.0, -math.inf, math.inf)
            a, b = (np.log(low), np.log(high)) if in_log else (low, high)
            mass = unit.log_mass((a - loc) * inverse, (b - loc) * inverse)
            total = mass + 0.5 * math.log(2 * math.pi) - np.log(inverse)
        elif prior.log:
            total = np.log(np.log(high) - np.log(low))
        else:
            total = np.log(high - low)
    return np.where(high > low, total, np.inf)
