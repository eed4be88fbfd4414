"""Identifiability as clients see it."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.before_data import Foresight, identifiability
from service.schemas import IdentifiabilityRequest

__all__ = ["identifiability_of"]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values.tolist()]


def identifiability_of(request: IdentifiabilityRequest) -> dict[str, Any]:
    """Foresee what frames would tell.

    Parameters
    ----------
    request : IdentifiabilityRequest
        Sensor, scene, ranges.

    Returns
    -------
    dict
        In the shape of `service.schemas.IdentifiabilityResponse`; null where something is not
        identifiable.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    RefusedError
        For tangential motion, and where a number overflows.
    """
    found: Foresight = identifiability(
        request.sensor, request.scene, request.ranges_m, request.object_present, request.at
    )
    bounds, posterior = found.sd, found.posterior_sd
    ranges = np.exp(found.experiment.log_r)
    information = found.information
    return {
        "rank": information.rank,
        "unknowns": len(information.names),
        "singular_values": information.singular_values.tolist(),
        "resolution": information.resolution,
        "directions": [
            {"cramer_rao_sd": _number(sd), "parameters": weights}
            for sd, weights in information.directions()
        ],
        "distinct_ranges": found.distinct,
        "needed_ranges": found.needed,
        "parameters": {
            name: {
                "value": _number(value),
                "cramer_rao_sd": _number(bounds.get(name, math.nan)),
                "posterior_sd": _number(posterior[name]),
            }
            for name, value in found.reference.items()
        },
        "range_m": {
            "value": _numbers(ranges),
            "cramer_rao_sd": _numbers(found.range_sd),
            "posterior_sd": _numbers(ranges * found.prediction.range_sd),
            "scale_cramer_rao_sd": _number(information.scale_sd),
            "scale_posterior_sd": _number(found.prediction.scale_sd),
        },
        "identifiability": [dataclasses.asdict(row) for row in found.identifiability],
    }
