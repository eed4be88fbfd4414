"""What the routes share: settings, jobs and the threads for numerical work."""

import dataclasses
from typing import Any, cast

import anyio
from fastapi import Request

from service.border.traces import Traces
from service.jobs import Jobs
from service.service_settings import ServiceSettings

__all__ = ["Shared", "client_of", "shared_of"]


@dataclasses.dataclass(frozen=True, slots=True)
class Shared:
    """One application's own.

    Attributes
    ----------
    settings : ServiceSettings
        What the operator chose.
    jobs : Jobs
        Posteriors that run or have run.
    threads : anyio.CapacityLimiter
        Bounds the threads of estimates and simulations.
    traces : Traces
        Counts of requests.
    """

    settings: ServiceSettings
    jobs: Jobs[Any, Any, Any, Any]  # whatever they compute
    threads: anyio.CapacityLimiter
    traces: Traces


def shared_of(request: Request) -> Shared:
    """Return what the routes share in the application that got a request."""
    return cast("Shared", request.app.state.shared)


def client_of(request: Request) -> str:
    """Return to whom what a request makes belongs: the id of its key, empty without keys."""
    return str(request.scope.get("hybridtof.client", ""))
