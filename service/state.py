"""What the routes share: settings, jobs and the threads for numerical work."""

import dataclasses
from typing import Any, cast

import anyio
from fastapi import Request

from service.jobs import Jobs
from service.settings import Settings

__all__ = ["State", "state_of"]


@dataclasses.dataclass(frozen=True, slots=True)
class State:
    """One application's own.

    Attributes
    ----------
    settings : Settings
        What the operator chose.
    jobs : Jobs
        Posteriors that run or have run.
    threads : anyio.CapacityLimiter
        Bounds the threads of estimates and simulations.
    """

    settings: Settings
    jobs: Jobs[Any, Any, Any, Any]  # whatever they compute
    threads: anyio.CapacityLimiter


def state_of(request: Request) -> State:
    """Return the state of the application that got a request."""
    return cast("State", request.app.state.shared)
