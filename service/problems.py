"""Every refusal as RFC 9457 ``application/problem+json``: the one place that maps errors to HTTP.

========================== ====== =====================================================
exception                  status meaning
========================== ====== =====================================================
InvalidInputError          422    JSON that breaks a rule; ``errors`` names every field
RefusedError               422    valid input for which no honest answer exists
OverdueError               422    valid input that takes longer than a request may
IdempotencyError           422    the key came before with another request
ClientGoneError            400    which nobody reads
MalformedError             400    not JSON, or an unreadable header or query parameter
UnauthorizedError          401    with ``WWW-Authenticate``
ForeignError               403    a page of another origin asks
NotFoundError              404
MethodError                405    with ``Allow``
NotAcceptableError         406    no form that ``Accept`` names
SlowClientError            408
ConflictError              409    not in a state to be asked this
GoneError                  410    was there, and is kept no longer
BodyTooLargeError          413
UnsupportedMediaTypeError  415    with what is accepted
MisdirectedError           421    ``Host`` is not one of the service's names
BusyError                  503    with ``Retry-After``
StoreError                 503    with ``Retry-After``; nothing that was accepted is lost
WorkerDiedError            500    of a job: a chunk of it ended every process that ran it
========================== ====== =====================================================

A refusal is 422 and not 409: it depends on the request alone, not on the state of a resource.
"""

import json
import logging
import uuid
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from service.errors import (
    BodyTooLargeError,
    BusyError,
    ClientGoneError,
    ConflictError,
    ForeignError,
    GoneError,
    IdempotencyError,
    MalformedError,
    MethodError,
    MisdirectedError,
    NotAcceptableError,
    NotFoundError,
    OverdueError,
    SlowClientError,
    StoreError,
    UnauthorizedError,
    UnsupportedMediaTypeError,
    WorkerDiedError,
)
from simulator.errors import HybridTofError, InvalidInputError, Problem, RefusedError, escape

__all__ = [
    "MEDIA_TYPE",
    "ErrorItem",
    "ProblemDetails",
    "describe",
    "install",
    "internal",
    "problem_responses",
    "response_of",
]

MEDIA_TYPE = "application/problem+json"
_TYPE = "urn:hybridtof:problem:"
# a client with a thousand mistakes is helped by the first hundred
_MAX_ERRORS = 100
_MAX_TEXT = 400

_log = logging.getLogger("hybridtof")


class ErrorItem(BaseModel):
    """One offending field."""

    pointer: str
    detail: str


class ProblemDetails(BaseModel):
    """RFC 9457 problem details with a JSON pointer for each offending field."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[ErrorItem]


_KINDS: Mapping[type[HybridTofError], tuple[HTTPStatus, str, str]] = {
    InvalidInputError: (HTTPStatus(422), "invalid-input", "The input breaks a rule"),
    RefusedError: (HTTPStatus(422), "refused", "There is no honest answer to this input"),
    OverdueError: (HTTPStatus(422), "overdue", "It takes longer than a request may"),
    ClientGoneError: (HTTPStatus(400), "gone-client", "The client hung up"),
    IdempotencyError: (HTTPStatus(422), "idempotency", "The idempotency key was used before"),
    MalformedError: (HTTPStatus.BAD_REQUEST, "malformed", "The request cannot be read"),
    UnauthorizedError: (HTTPStatus.UNAUTHORIZED, "unauthorized", "A key is needed"),
    ForeignError: (HTTPStatus.FORBIDDEN, "foreign", "The request comes from somebody else's page"),
    MethodError: (HTTPStatus(405), "method-not-allowed", "There is no such method here"),
    MisdirectedError: (HTTPStatus(421), "misdirected", "The request is for another host"),
    NotFoundError: (HTTPStatus.NOT_FOUND, "not-found", "There is no such resource"),
    NotAcceptableError: (HTTPStatus(406), "not-acceptable", "There is no form that is accepted"),
    ConflictError: (HTTPStatus.CONFLICT, "conflict", "This cannot be asked now"),
    GoneError: (HTTPStatus.GONE, "gone", "It is kept no longer"),
    SlowClientError: (HTTPStatus.REQUEST_TIMEOUT, "timeout", "The request takes too long to come"),
    BodyTooLargeError: (HTTPStatus(413), "too-large", "The body is too large"),
    UnsupportedMediaTypeError: (
        HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
        "media-type",
        "The body must be JSON",
    ),
    BusyError: (HTTPStatus.SERVICE_UNAVAILABLE, "busy", "The service takes no more work now"),
    StoreError: (HTTPStatus.SERVICE_UNAVAILABLE, "store", "The store of jobs does not answer"),
    WorkerDiedError: (HTTPStatus(500), "worker-died", "The computation ended its process"),
}


def _shorten(text: str) -> str:
    return text if len(text) <= _MAX_TEXT else text[: _MAX_TEXT - 1] + "…"


def _details(
    status: int, slug: str, title: str, detail: str, problems: Sequence[Problem] = ()
) -> dict[str, Any]:
    errors = [
        {"pointer": _shorten(p.pointer), "detail": _shorten(p.message)}
        for p in problems[:_MAX_ERRORS]
    ]
    return {
        "type": _TYPE + slug,
        "title": title,
        "status": int(status),
        "detail": _shorten(detail),
        "errors": errors,
    }


def describe(error: HybridTofError) -> dict[str, Any]:
    """Return an exception as problem details.

    Parameters
    ----------
    error : HybridTofError
        Anything of the exception tree.

    Returns
    -------
    dict
        Members of `ProblemDetails`; status 500 for an exception that is not in the table.
    """
    status, slug, title = next(
        (kind for cls, kind in _KINDS.items() if isinstance(error, cls)),
        (HTTPStatus.INTERNAL_SERVER_ERROR, "internal", "The service failed"),
    )
    named = InvalidInputError | RefusedError | ConflictError
    problems = error.problems if isinstance(error, named) else ()
    detail = str(error)
    if len(problems) > 1 and isinstance(error, InvalidInputError):
        detail = f"{len(problems)} fields break a rule; {detail}"
    return _details(status, slug, title, detail, problems)


def _response(details: Mapping[str, Any], headers: Mapping[str, str] | None = None) -> Response:
    # ASCII, so that whatever a client wrote into a field's name can be said back
    body = json.dumps(details, allow_nan=False).encode("ascii")
    return Response(body, details["status"], headers, MEDIA_TYPE)


def _headers(error: HybridTofError) -> Mapping[str, str]:
    if isinstance(error, BusyError | StoreError):
        return {"Retry-After": "5"}
    if isinstance(error, UnauthorizedError):
        return {"WWW-Authenticate": 'Bearer realm="hybridtof"'}
    if isinstance(error, MethodError):
        return {"Allow": error.allow}
    if isinstance(error, UnsupportedMediaTypeError):
        return {"Accept": error.accept, "Accept-Encoding": "identity"}
    return {}


def response_of(error: HybridTofError) -> Response:
    """Return the answer to a request that met an exception.

    Parameters
    ----------
    error : HybridTofError
        Anything of the exception tree.

    Returns
    -------
    Response
        With what the status asks for in headers; 500, and a line in the log, where the error is
        the service's own.
    """
    details = describe(error)
    if details["status"] == HTTPStatus.INTERNAL_SERVER_ERROR:
        return internal(error)
    return _response(details, _headers(error))


async def _on_known(_: Request, error: Exception) -> Response:
    assert isinstance(error, HybridTofError)  # noqa: S101 (registered for this class alone)
    return response_of(error)


async def _on_http(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101
    status = HTTPStatus(error.status_code)
    if status == HTTPStatus.NO_CONTENT:
        return Response(status_code=status, headers=error.headers)
    slug = status.phrase.lower().replace(" ", "-")
    details = _details(status, slug, status.phrase, str(error.detail))
    return _response(details, error.headers)


async def _on_parameters(_: Request, error: Exception) -> Response:
    """Path, query and header parameters that FastAPI itself checks."""
    assert isinstance(error, RequestValidationError)  # noqa: S101
    problems = [
        Problem("/" + "/".join(escape(str(part)) for part in item["loc"]), item["msg"])
        for item in error.errors()
    ]
    return _response(describe(InvalidInputError(*problems)))


async def _on_unknown(_: Request, error: Exception) -> Response:
    return internal(error)


def internal(error: Exception) -> Response:
    """Return the answer to a request that met a fault of the service, and write it down.

    Parameters
    ----------
    error : Exception
        The fault, of which the answer tells nothing but where the log has it.
    """
    reference = uuid.uuid4().hex
    _log.error("internal error %s", reference, exc_info=error)
    detail = f"an error of the service itself; its log has it under {reference}"
    return _response(
        _details(HTTPStatus.INTERNAL_SERVER_ERROR, "internal", "The service failed", detail)
    )


def install(app: FastAPI) -> None:
    """Let an application answer every refusal with problem details."""
    app.add_exception_handler(HybridTofError, _on_known)
    app.add_exception_handler(HTTPException, _on_http)
    app.add_exception_handler(RequestValidationError, _on_parameters)
    app.add_exception_handler(Exception, _on_unknown)


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return what OpenAPI says of the refusals of a route.

    Parameters
    ----------
    *statuses : int
        HTTP status codes.

    Returns
    -------
    dict
        For FastAPI's ``responses``.
    """
    schema = {"$ref": f"#/components/schemas/{ProblemDetails.__name__}"}
    return {
        status: {
            "description": HTTPStatus(status).phrase,
            "content": {MEDIA_TYPE: {"schema": schema}},
        }
        for status in statuses
    }
