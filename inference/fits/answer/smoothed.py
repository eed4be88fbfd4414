"""Fits about which frames scatter less than their noise lets them: readings that were smoothed."""

from collections.abc import Mapping
from typing import Any

__all__ = ["SCATTER", "SMOOTHED", "smoothed"]

SCATTER = "scatter"
"""Name, among the checks of a fit, of how often frames scatter as little by the stated noise."""

SMOOTHED = (
    "frames scatter about the fit by far less than the stated noise lets them. If that noise is "
    "stated too large, standard deviations are too large as well. If a sensor or its driver "
    "smooths readings over frames (a low-pass, a running mean), ranges are late by as much as the "
    "object moves meanwhile, and may be sure and wrong without a misfit: send readings that are "
    "not smoothed, with their own noise"
)
"""What it means, for a person."""

_FALSE_ALARM = 1e-4  # how often a fit whose noise is as stated is doubted


def smoothed(fit: Mapping[str, Any] | None) -> bool:
    """Tell whether frames scatter less about a fit than their noise lets them.

    See docs/model.md, succession.

    Parameters
    ----------
    fit : mapping, optional
        Of a `TechniqueResult`.
    """
    return fit is not None and fit["checks"].get(SCATTER, 1.0) < _FALSE_ALARM
