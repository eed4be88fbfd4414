"""What the routes share: settings, jobs and the threads for numerical work."""

import dataclasses
from typing import Any, cast

from starlette.requests import HTTPConnection

from service.border.traces import Traces
from service.jobs import Jobs
from service.lanes import Processes, Threads
from service.service_settings import ServiceSettings
from service.streams.streams import Streams
from service.warm.warming import Warming

__all__ = ["SMALL", "TINY", "TINY_BYTES", "Shared", "client_of", "shared_of"]

SMALL = 10_000
"""Frames of which an answer is made in milliseconds."""

TINY, TINY_BYTES = 1000, 2**16
"""Frames, and bytes of a body, whose work takes less time than handing it to a thread may."""


@dataclasses.dataclass(frozen=True, slots=True)
class Shared:
    """One application's own.

    Attributes
    ----------
    settings : ServiceSettings
        What the operator chose.
    jobs : Jobs
        Posteriors that run or have run.
    parsing, threads : Threads
        For bodies, and for answers that are small.
    processes : Processes
        For answers that may take long.
    traces : Traces
        Counts of requests.
    streams : Streams
        Those of clients.
    warming : Warming or None
        Makes machine code ahead of the first question.
    """

    settings: ServiceSettings
    jobs: Jobs[Any, Any, Any, Any]  # whatever they compute
    parsing: Threads
    threads: Threads
    processes: Processes
    traces: Traces
    streams: Streams
    warming: Warming | None = None

    def lane(self, frames: int) -> Threads | Processes:
        """Return where an answer about so many frames is made: of few, at once in a thread."""
        return self.threads if frames <= SMALL else self.processes


def shared_of(request: HTTPConnection) -> Shared:
    """Return what the routes share in the application that got a request."""
    return cast("Shared", request.app.state.shared)


def client_of(request: HTTPConnection) -> str:
    """Return to whom what a request makes belongs: the id of its key, empty without keys."""
    return str(request.scope.get("hybridtof.client", ""))
