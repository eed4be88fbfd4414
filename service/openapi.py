"""The OpenAPI document, with the bodies that the service reads by itself."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from service.problems import ProblemDetails
from service.schemas import (
    EstimateRequest,
    IdentifiabilityRequest,
    PosteriorRequest,
    SimulationRequest,
)

__all__ = ["install"]

_MODELS: tuple[type[BaseModel], ...] = (
    EstimateRequest,
    IdentifiabilityRequest,
    PosteriorRequest,
    SimulationRequest,
)


def install(app: FastAPI) -> None:
    """Let the application describe itself, once, when it is asked to.

    Parameters
    ----------
    app : FastAPI
        The application.
    """

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title, version=app.version, description=app.description, routes=app.routes
            )
            reference = "#/components/schemas/{model}"
            for mode, models in (("validation", _MODELS), ("serialization", (ProblemDetails,))):
                _, found = models_json_schema(
                    [(model, mode) for model in models],  # type: ignore[misc]
                    ref_template=reference,
                )
                document["components"]["schemas"] |= found["$defs"]
            _drop_supposed_refusals(document)
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's own way to extend it


def _drop_supposed_refusals(document: dict[str, Any]) -> None:
    """Remove the 422 that FastAPI supposes of every parameter; those that occur are declared."""
    supposed = {
        "application/json": {"schema": {"$ref": "#/components/schemas/HTTPValidationError"}}
    }
    for operations in document["paths"].values():
        for operation in operations.values():
            if operation["responses"].get("422", {}).get("content") == supposed:
                del operation["responses"]["422"]
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
