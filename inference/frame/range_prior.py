"""The prior density of a range, along log r, and where it leaves anything."""

import math

from inference.frame.arguments import Pair, RangePrior
from simulator.compiled import compiled

__all__ = [
    "LEAST_INFORMATION",
    "integration_bounds",
    "log_range_density",
    "log_resolved",
    "prior_curvature",
    "prior_slope",
]

LEAST_INFORMATION = 25.0
"""Fisher information on log r below which a reference prior turns log-uniform.

A range is then told to worse than a fifth of itself. Frames that dark lie at the end of the curve
of readings, where the root of the information leaves next to no mass: it would take them for
brighter ones, each by a fraction of its noise and all in one direction (docs/model.md,
reference-prior).
"""

_REACH = 9.0  # standard deviations of a normal prior beyond which it leaves nothing
_FARTHEST = 38.5  # at which its density is no number any more: so far readings may contradict it
_FACTOR = 3.0  # log range up to which that is looked at


@compiled
def log_range_density(r: float, u: float, prior: RangePrior) -> float:
    """Return the log prior density of u = log r; the reference prior is flat."""
    linear = (r - prior.mean) * prior.inverse_sd
    logarithmic = (u - prior.log_mean) * prior.log_inverse_sd
    square = linear * linear + logarithmic * logarithmic
    return prior.constant + (prior.power + 1.0) * u - 0.5 * square


@compiled
def log_resolved(told: float, dark: float) -> float:
    """Return the log of a reference prior along log r, but for a constant.

    Parameters
    ----------
    told : float
        Fisher information of a frame on its log r, in units of `LEAST_INFORMATION`.
    dark : float
        The law where nothing is told (`inference.frame.dark_mass`).
    """
    return math.log((told + dark) / math.sqrt(1.0 + told))


@compiled
def prior_slope(r: float, u: float, prior: RangePrior) -> float:
    """Return the derivative of `log_range_density` along u."""
    pull = r * (r - prior.mean) * prior.inverse_sd * prior.inverse_sd
    return (
        prior.power
        + 1.0
        - pull
        - (u - prior.log_mean) * prior.log_inverse_sd * prior.log_inverse_sd
    )


@compiled
def prior_curvature(r: float, prior: RangePrior) -> Pair:
    """Return the curvatures of the two squares in `log_range_density`, that of log r first."""
    return (
        prior.log_inverse_sd * prior.log_inverse_sd,
        r * r * prior.inverse_sd * prior.inverse_sd,
    )


@compiled
def integration_bounds(prior: RangePrior) -> Pair:
    """Return the interval of u = log r that holds all the mass but rounding.

    Also that of a posterior whose readings contradict a narrow prior: cut where the prior alone
    leaves nothing, it would pile up at the cut. The first bound is the larger where nothing is
    left, or where the prior is not finite.
    """
    low, high = prior.low, prior.high
    if not math.isfinite(prior.constant):
        return 0.0, -1.0
    if prior.inverse_sd > 0.0:
        # from the point of the support where the density is largest: it may be an end
        centre = min(max(prior.mean, low), high)
        reach = _FARTHEST / prior.inverse_sd
        low, high = max(low, centre - reach), min(high, centre + reach)
    if not high > low or not high > 0.0:
        return 0.0, -1.0
    # only a prior that is not one of log r has next to nothing near zero
    floor = 1e-6 * high if prior.power > -1.0 else 1e-300
    first, last = math.log(max(low, floor)), math.log(high)
    if prior.log_inverse_sd > 0.0:
        centre = min(max(prior.log_mean, first), last)
        reach = max(_REACH / prior.log_inverse_sd, min(_FARTHEST / prior.log_inverse_sd, _FACTOR))
        first, last = max(first, centre - reach), min(last, centre + reach)
    return first, last
