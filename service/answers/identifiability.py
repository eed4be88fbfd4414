"""Identifiability as clients see it."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.offers import Offer
from inference.identifiability.status import Identifiability
from service.answers.posteriors import SHAPES
from service.answers.shape import model_of
from service.requests import IdentifiabilityRequest

__all__ = ["ForeseenIdentifiability", "IdentifiabilityResponse", "identifiability_of"]


@dataclasses.dataclass(frozen=True)
class Bound:
    """What frames would tell of one unknown."""

    value: float | None
    cramer_rao_sd: float | None
    posterior_sd: float | None


@dataclasses.dataclass(frozen=True)
class RangeBounds:
    """What frames would tell of the ranges [m], and of their common scale."""

    value: list[float | None]
    cramer_rao_sd: list[float | None]
    posterior_sd: list[float | None]
    scale_cramer_rao_sd: float | None
    scale_posterior_sd: float | None


@dataclasses.dataclass(frozen=True)
class Direction:
    """Weights of the unknowns that make up a direction, and its bound."""

    cramer_rao_sd: float | None
    parameters: dict[str, float]


@dataclasses.dataclass(frozen=True)
class ForeseenIdentifiability:
    """Answer of ``POST /v1/identifiability``.

    Attributes
    ----------
    rank : int
        Directions of the unknowns that noise-free readings tell, the ranges being unknown too.
    unknowns : int
        Number of unknowns that the readings depend on; identifiable are all where rank equals it.
    singular_values : list of float
        Of the whitened Jacobian, ranges eliminated, along log c0, c1 / sqrt(c0), log c2, crosstalk
        in units of the scene's light, log B, log R, log c0' and c1' / sqrt(c0').
    resolution : float
        Singular value, relative to a Jacobian scaled to unit rows and columns, below which rounding
        does not tell it from zero.
    directions : list
        Directions along the same coordinates that the readings do not tell (null), then the worst
        of the others with its bound: weights of the unknowns that make each up.
    distinct_ranges, needed_ranges : int
        Distinct ranges that there are, and that the unknowns need at least.
    parameters : dict
        Every unknown in SI units: value at which the bounds hold, Cramer-Rao bound of the readings
        alone (null: not identifiable, or a parameter of the ranges' prior), predicted posterior
        standard deviation, prior included.
    range_m : object
        The same for every range [m], null for a frame without object, and for the common scale of
        the ranges (the mean of log r).
    identifiability : list
        A status and a reason for every unknown and for ``range_m``: as at least three of four draws
        of the priors have it, where that is worse than at the values of reference.
    over_priors : dict
        Of each of them how many of eight draws of the priors have each status; empty where ``at``
        gives all unknowns.
    remedies : dict
        For each of them that is not identified what would help: the kind (``empty``: frames without
        the object; ``distance``, ``distances``: the object at one or two known distances;
        ``odometry``; ``motion``: a wider stroke), words for it, the Cramer-Rao bound that it would
        give, relative as in the reasons, at most half of what it is and below one, and the status.
        What would have it identified comes first, and of what achieves as much the cheapest.
    """

    rank: int
    unknowns: int
    singular_values: list[float]
    resolution: float
    directions: list[Direction]
    distinct_ranges: int
    needed_ranges: int
    parameters: dict[str, Bound]
    range_m: RangeBounds
    identifiability: tuple[Identifiability, ...]
    over_priors: dict[str, dict[str, int]]
    remedies: dict[str, tuple[Offer, ...]]


IdentifiabilityResponse = model_of(ForeseenIdentifiability, SHAPES)


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values.tolist()]


def identifiability_of(request: IdentifiabilityRequest) -> ForeseenIdentifiability:
    """Foresee what frames would tell.

    Parameters
    ----------
    request : IdentifiabilityRequest
        Sensor, scene, ranges.

    Returns
    -------
    ForeseenIdentifiability
        None where something is not identifiable.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    RefusedError
        For tangential motion, and where a number overflows.
    """
    found: Foresight = identifiability(
        request.sensor,
        request.scene,
        request.ranges_m,
        request.object_present,
        request.at,
        known_range_sd_m=request.known_range_sd_m,
        displacement_sd_m=request.displacement_sd_m,
        temperature_k=request.temperature_k,
    )
    bounds, posterior = found.sd, found.posterior_sd
    ranges = np.exp(found.experiment.log_r)
    information = found.information
    return ForeseenIdentifiability(
        rank=information.rank,
        unknowns=len(information.names),
        singular_values=information.singular_values.tolist(),
        resolution=information.resolution,
        directions=[Direction(_number(sd), weights) for sd, weights in information.directions()],
        distinct_ranges=found.distinct,
        needed_ranges=found.needed,
        parameters={
            name: Bound(
                value=_number(value),
                cramer_rao_sd=_number(bounds.get(name, math.nan)),
                posterior_sd=_number(posterior[name]),
            )
            for name, value in found.reference.items()
        },
        range_m=RangeBounds(
            value=_numbers(ranges),
            cramer_rao_sd=_numbers(found.range_sd),
            posterior_sd=_numbers(ranges * found.posterior.range_sd),
            scale_cramer_rao_sd=_number(information.scale_sd),
            scale_posterior_sd=_number(found.posterior.scale_sd),
        ),
        identifiability=tuple(found.identifiability),
        over_priors=found.over_priors,
        remedies=found.remedies,
    )
