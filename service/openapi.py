"""The OpenAPI document: what FastAPI says of the routes, and what it cannot know.

Bodies that the service reads by itself, with examples; what the border answers; where a posterior
or a stream that was asked for is found; and tags of unions, which have to be sent although Python
may leave them out.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from fastapi import APIRouter, FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from service.bodies import BodyOf
from service.border.gate import WITHOUT_KEY
from service.examples import EXAMPLES
from service.problems import ProblemDetails, problem_responses

__all__ = ["install", "name_of"]

# what makes something, the answer that says so, and the parameter that names it
_MADE = (("/v1/posteriors", "202", "job_id"), ("/v1/streams", "201", "stream_id"))


def name_of(route: APIRoute) -> str:
    """Name an operation: its resource and what is done, for methods of generated clients."""
    return f"{route.tags[0]}_{route.name}"


def _bodies(routers: Sequence[APIRouter]) -> Iterator[tuple[str, str, type[BaseModel]]]:
    """Yield path, method and type of every body that `BodyOf` reads."""
    for route in (route for router in routers for route in router.routes):
        if not isinstance(route, APIRoute):
            continue
        for dependency in route.dependant.dependencies:
            if isinstance(dependency.call, BodyOf):
                for method in route.methods or ():
                    yield route.path_format, method.lower(), dependency.call.model


def install(app: FastAPI, routers: Sequence[APIRouter]) -> None:
    """Let the application describe itself, once, when it is asked to.

    Parameters
    ----------
    routers : sequence of APIRouter
        Its routers.
    """

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title, version=app.version, description=app.description, routes=app.routes
            )
            bodies = list(_bodies(routers))
            models = {model: None for _, _, model in bodies}
            references, found = models_json_schema(
                [(model, "validation") for model in models] + [(ProblemDetails, "serialization")],
                ref_template="#/components/schemas/{model}",
            )
            document["components"]["schemas"] |= found["$defs"]
            for path, method, model in bodies:
                document["paths"][path][method]["requestBody"] = {
                    "required": True,
                    "content": {
                        "application/json": {
                            "schema": references[model, "validation"],
                            "examples": EXAMPLES.get(model, {}),
                        }
                    },
                }
            for schema in document["components"]["schemas"].values():
                _tell_what_is_sent(schema)
            _add_links(document)
            _drop_supposed_refusals(document)
            _add_border(document)
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's own way to extend it


def _tell_what_is_sent(schema: dict[str, Any]) -> None:
    """Require what a union is told by, and leave out defaults that are whole objects.

    Who generates a client cannot write such a default down; the field's text says what it is.
    """
    for name, member in schema.get("properties", {}).items():
        if "const" in member and "default" in member:
            del member["default"]
            schema["required"] = sorted({*schema.get("required", ()), name})
        elif isinstance(member.get("default"), dict | list):
            del member["default"]


def _add_links(document: dict[str, Any]) -> None:
    """Say where what was made is found, and what can be done with it."""
    paths = document["paths"]
    for root, status, parameter in _MADE:
        links = {
            operation["operationId"]: {
                "operationId": operation["operationId"],
                "parameters": {parameter: "$response.body#/id"},
            }
            for path, operations in paths.items()
            for operation in operations.values()
            if path.startswith(f"{root}/{{{parameter}}}")
        }
        made = paths[root]["post"]["responses"][status]
        made["links"] = links
        made["headers"] = {
            "Location": {"required": True, "schema": {"type": "string", "format": "uri-reference"}}
        }


def _add_border(document: dict[str, Any]) -> None:
    """Say of every operation what the border answers, and where a key is needed."""
    bearer = {"type": "http", "scheme": "bearer", "description": "where the service has keys"}
    document["components"]["securitySchemes"] = {"key": bearer}
    for path, operations in document["paths"].items():
        open_to_all = path in WITHOUT_KEY
        for operation in operations.values():
            refusals = (403, 421) if open_to_all else (401, 403, 421)
            if "requestBody" in operation:
                refusals = (*refusals, 408, 503)
            for status, response in problem_responses(*refusals).items():
                operation["responses"].setdefault(str(status), response)
            if not open_to_all:
                operation["security"] = [{"key": []}, {}]


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
