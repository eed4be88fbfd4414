"""Every golden request, by the floor that answers it."""

from collections.abc import Callable
from typing import Any

from tests.golden import fits, foresight, posteriors, realtime, tracks

__all__ = ["GROUPS"]

GROUPS: dict[str, dict[str, Callable[[], dict[str, Any]]]] = {
    "realtime": realtime.REQUESTS,
    "fits": fits.REQUESTS,
    "identifiability": foresight.REQUESTS,
    "posterior": posteriors.REQUESTS,
    "tracking": tracks.REQUESTS,
}
