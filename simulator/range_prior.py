"""The prior of the ranges: stated or by default, cut by sensor and background, normalised."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.errors import RefusedError
from simulator.priors import (
    Distribution,
    LogNormal,
    NormalDistribution,
    RangeForm,
    Uniform,
    UniformDistribution,
)
from simulator.scene import Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor
from simulator.unknowns import Unknown, Values

__all__ = ["RangePrior", "range_prior", "range_prior_rows", "stroke_unknowns"]

Array = NDArray[np.float64]
RangePrior = Distribution | Stroke | Reference

_DEFAULT_RANGE = (0.02, 20.0)
_UNIT = NormalDistribution(log=False, loc=0.0, scale=1.0, low=-math.inf, high=math.inf)
_STROKE_SPREAD = LogNormal(median=0.5, sigma=1.0).distribution()


def range_prior(sensor: Sensor, scene: Scene) -> RangePrior:
    """Return the prior of the ranges, cut to what the sensor reaches and a known background.

    Where the scene states none it is the reference prior: an object on its way is the rule, and
    independent draws are for those to state who know that they are. The one range of an object at
    rest is one draw: there is no spread to take anything from, and its law is log-uniform, which
    unlike a reference prior has the same mass whatever the other unknowns are.
    """
    limit = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
    if scene.background is not None and isinstance(scene.background.distance_m, float | int):
        limit = min(limit, scene.background.distance_m)
    if scene.range_m is None:
        high = min(sensor.max_range_m, _DEFAULT_RANGE[1], limit)
        # a sensor that sees less than 2 cm still has ranges
        low = _DEFAULT_RANGE[0] if high > _DEFAULT_RANGE[0] else high / 100
        # neither is validated: sizes are asked of what is stated, not of what follows from it
        if scene.motion == "static":
            return UniformDistribution(log=True, low=low, high=high)
        return Reference.model_construct(low=low, high=high)
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


def range_prior_rows(prior: RangePrior, values: Values, background: Array | None, n: int) -> Array:
    """Return the prior densities of a range given n parameter vectors.

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

    Raises
    ------
    RefusedError
        For a law that is no prior of ranges.
    """
    rows = np.zeros((n, 8))
    form = _form_of(prior)
    rows[:, 1:6] = form
    rows[:, 6], rows[:, 7] = prior.low, prior.high
    if isinstance(prior, Stroke):
        rows[:, 4] = np.log(values["range_m.centre"])
        with np.errstate(divide="ignore", over="ignore"):  # far out in z a spread underflows
            rows[:, 5] = 1.0 / values["range_m.spread"]
    if background is not None:
        # a shadow with c1' < 0 is negative below r = -c1': such ranges are not physical
        rows[:, 6] = np.maximum(rows[:, 6], -background[:, 3])
        # and an object stands before its background: else a frame whose object is dark could
        # lie anywhere behind it, where nothing contradicts, and draw the other unknowns along
        rows[:, 7] = np.minimum(rows[:, 7], background[:, 1])
    low, high = rows[:, 6], rows[:, 7]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if isinstance(prior, Reference):  # a density per distinguishable range: no integral
            total = np.zeros(n)
        elif isinstance(prior, Stroke) or form.inverse_log_sd > 0.0:
            total = _log_normal_integral(np.log(low), np.log(high), rows[:, 4], rows[:, 5])
        elif form.inverse_sd > 0.0:
            total = _log_normal_integral(low, high, rows[:, 2], rows[:, 3])
        else:
            total = np.log(np.log(high) - np.log(low)) if form.power else np.log(high - low)
    rows[:, 0] = -np.where(high > low, total, np.inf)
    return rows


def _form_of(prior: RangePrior) -> RangeForm:
    """Return what does not depend on the unknowns of a prior of the ranges."""
    if isinstance(prior, Stroke | Reference):
        return RangeForm(-1.0)
    if prior.range_form is None:
        raise RefusedError(f"{type(prior).__name__} is no prior of ranges")
    return prior.range_form


def _log_normal_integral(a: Array, b: Array, loc: Array, inverse: Array) -> Array:
    """Log integral of exp(-((x - loc) inverse)^2 / 2) between a and b."""
    mass = _UNIT.log_mass((a - loc) * inverse, (b - loc) * inverse)
    return np.asarray(mass + 0.5 * math.log(2 * math.pi) - np.log(inverse))
