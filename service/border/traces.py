"""What is remembered of requests: a line in the log, and counts that Prometheus reads.

Neither has what a request said: no query, no header, no body. A path is told by its template.
"""

import contextvars
import dataclasses
import logging
import random
import re
from collections.abc import Callable, Iterator, Mapping

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector
from starlette.types import Scope

__all__ = ["REQUEST_ID", "Traces", "request_id"]

REQUEST_ID: contextvars.ContextVar[str | None] = contextvars.ContextVar("request_id", default=None)
"""Of the request that is being answered."""

_log = logging.getLogger("hybridtof.requests")
_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT"})
_SECONDS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
# of people who went away nothing can be said by HTTP; this number is what others use
_GONE = 499


def request_id(given: str | None) -> str:
    """Return the id of a request: the client's own, where it is one, or a new one."""
    return (
        given if given is not None and _ID.fullmatch(given) else f"{random.getrandbits(128):032x}"
    )


class _Jobs(Collector):
    """How many posteriors there are, asked when it is asked for."""

    def __init__(self, counts: Callable[[], Mapping[str, int]]) -> None:
        self._counts = counts

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """Yield one family."""
        family = GaugeMetricFamily(
            "hybridtof_posteriors", "Posteriors in the store", labels=["status"]
        )
        for status, count in self._counts().items():
            family.add_metric([status], count)
        yield family


@dataclasses.dataclass(frozen=True, slots=True)
class Told:
    """What became of a request.

    Attributes
    ----------
    status : int or None
        None where no answer was begun.
    sent : int
        Bytes of the answer's body.
    seconds : float
        From its head to its end.
    """

    status: int | None
    sent: int
    seconds: float


class Traces:
    """Counts of one application, shared with no other.

    Parameters
    ----------
    counts : callable
        Returns how many posteriors have each status.
    """

    def __init__(self, counts: Callable[[], Mapping[str, int]]) -> None:
        self._registry = CollectorRegistry()
        self._registry.register(_Jobs(counts))
        self._requests = Counter(
            "hybridtof_requests",
            "Requests that were answered",
            ["method", "route", "status"],
            registry=self._registry,
        )
        self._seconds = Histogram(
            "hybridtof_request_seconds",
            "Time until an answer was sent",
            ["route"],
            buckets=_SECONDS,
            registry=self._registry,
        )
        self._counted: dict[tuple[str, str, int], tuple[Counter, Histogram]] = {}
        self.open = Gauge(
            "hybridtof_requests_open", "Requests that wait for an answer", registry=self._registry
        )

        self.lines = Counter(
            "hybridtof_stream_lines",
            "Lines of streams, by what became of them",
            ["outcome"],
            registry=self._registry,
        )
        self.producers = Gauge(
            "hybridtof_stream_producers", "Clients that send to a stream", registry=self._registry
        )

    def tell(self, scope: Scope, told: Told) -> None:
        """Count a request, and write its line."""
        method = scope.get("method", "GET")  # a WebSocket begins as one, and has none
        method = method if method in _METHODS else "other"
        route = scope.get("hybridtof.route", "none")
        status = _GONE if told.status is None else told.status
        kind = (method, route, status)
        if kind not in self._counted:  # to be looked up once, not at every request
            counted = self._requests.labels(method, route, str(status))
            self._counted[kind] = (counted, self._seconds.labels(route))
        counts, seconds = self._counted[kind]
        counts.inc()
        seconds.observe(told.seconds)
        fields = {
            "method": method,
            "route": route,
            "status": status,
            "sent_bytes": told.sent,
            "seconds": round(told.seconds, 6),
            "client": scope.get("hybridtof.client", ""),
        }
        level = logging.WARNING if status >= 500 else logging.INFO
        if route.startswith("/health/"):  # which is asked all day
            level = logging.DEBUG
        if _log.isEnabledFor(level):
            # without a search for the line of source that says this, at every request
            what, args = "%s %s %s", (method, route, status)
            record = logging.LogRecord(_log.name, level, __file__, 0, what, args, None)
            record.fields = fields
            _log.handle(record)

    def text(self) -> bytes:
        """Return all counts in the form that Prometheus reads."""
        return generate_latest(self._registry)
