"""Posteriors as clients see them: what is not known yet is null."""

from typing import Any, Literal

import pydantic

from inference.identifiability.status import Identifiability
from inference.posterior.answer.error_parts import ParameterErrorParts
from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.answer.posterior import ParameterSummary, Posterior, Runtime
from inference.posterior.selection.selection import CandidateSummary
from service.answers.shape import Shape, model_of
from service.store.record import JobRecord, Status

__all__ = ["SHAPES", "PosteriorBrief", "PosteriorPage", "PosteriorResponse", "brief", "full"]

_CHECKS = Literal["total", "worst_frame", "neighbours", "wander", "flux_error"]

SHAPES: dict[type, Shape] = {
    # mean and sd are nan where there are several modes, which have their own; all where nothing
    # was drawn
    ParameterSummary: Shape(
        missing=frozenset({"mean", "sd", "q05", "q50", "q95", "ess_bulk", "ess_tail", "mcse_mean"})
    ),
    ParameterErrorParts: Shape(missing=frozenset({"noise", "scene", "model"})),
    Identifiability: Shape(
        types={
            "status": Literal["identified", "weak", "not_identified"],
            "contraction": float | None,
        }
    ),
    FitCheck: Shape(types={"name": _CHECKS}),
    Fit: Shape(missing=frozenset({"p_value", "chi_square", "degrees_of_freedom"})),
    CandidateSummary: Shape(
        missing=frozenset(
            {
                "log_evidence",
                "log_evidence_error",
                "log_predictive",
                "log_predictive_error",
                "predictive_k_hat",
            }
        )
    ),
    # the draws are a resource of their own; runtime follows the selection
    Posterior: Shape(without=frozenset({"method", "seed", "draws", "runtime"})),
}


class _Progress(pydantic.BaseModel):
    phase: Literal["queued", "compiling", "starting", "tempering", "sampling", "summarising"]
    steps: int
    target: int | None
    ess: float | None
    rhat: float | None
    eta_s: float | None


class PosteriorBrief(pydantic.BaseModel):
    """How a posterior stands."""

    id: str
    status: Status
    method: str
    seed: int
    progress: _Progress


class PosteriorPage(pydantic.BaseModel):
    """Answer of ``GET /v1/posteriors``: the newest first."""

    items: list[PosteriorBrief]
    next_cursor: str | None


_RESULTS = model_of(Posterior, SHAPES, {"runtime": model_of(Runtime, SHAPES)}).model_fields

# each is null until the posterior has ended
_members: dict[str, Any] = {
    name: (field.annotation | None, ...)  # type: ignore[operator]
    for name, field in _RESULTS.items()
}
PosteriorResponse = pydantic.create_model(
    "PosteriorResponse",
    __doc__="Answer of ``GET /v1/posteriors/{id}``; what is not known yet is null.",
    __base__=PosteriorBrief,
    **_members,
    problem=(dict[str, Any] | None, None),
)


def brief(record: JobRecord) -> dict[str, Any]:
    """Return how a posterior stands, without its results."""
    return {name: getattr(record, name) for name in PosteriorBrief.model_fields}


def full(record: JobRecord) -> dict[str, Any]:
    """Return the body of ``GET /v1/posteriors/{id}``; a failed one has its ``problem``."""
    body = brief(record) | dict.fromkeys(_RESULTS) | (record.result or {})
    return body if record.problem is None else body | {"problem": record.problem}
