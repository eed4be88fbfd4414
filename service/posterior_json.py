"""A posterior as JSON: what is not known yet is null."""

from typing import Any

from service.job_store import JobRecord

__all__ = ["brief", "full"]

_RESULTS = (
    "verdict",
    "parameters",
    "modes",
    "range_m",
    "identifiability",
    "fit",
    "left_out",
    "selection",
    "runtime",
)


def brief(record: JobRecord) -> dict[str, Any]:
    """Return how a posterior stands, without its results."""
    return {
        "id": record.id,
        "status": record.status,
        "method": record.method,
        "seed": record.seed,
        "progress": record.progress,
    }


def full(record: JobRecord) -> dict[str, Any]:
    """Return the body of ``GET /v1/posteriors/{id}``; a failed one has its ``problem``."""
    body = brief(record) | dict.fromkeys(_RESULTS) | (record.result or {})
    return body if record.problem is None else body | {"problem": record.problem}
