"""Request bodies: bytes, bounded; then JSON; then a validated request."""

from collections.abc import AsyncIterator
from typing import Generic, TypeVar

import anyio.to_thread
from fastapi import Request

from service.errors import BodyTooLargeError, MalformedError, UnsupportedMediaTypeError
from service.shared import shared_of
from service.strict_json import check_bulk, decode
from simulator.validated import Validated, parse

__all__ = ["BodyOf", "parse_document", "read_limited"]

T = TypeVar("T", bound=Validated)


def parse_document(model: type[T], raw: bytes) -> T:
    """Read one JSON document as a validated type.

    Parameters
    ----------
    model : type
        A subclass of `Validated`.
    raw : bytes
        JSON text.

    Returns
    -------
    Validated
        An instance of ``model``.

    Raises
    ------
    MalformedError
        Where it is not JSON.
    InvalidInputError
        With a pointer for each offending field.
    """
    data = decode(raw)
    check_bulk(data)
    return parse(model, data)


async def read_limited(chunks: AsyncIterator[bytes], declared: str | None, limit: int) -> bytes:
    """Collect a body, and stop as soon as it is too large.

    Parameters
    ----------
    chunks : async iterator of bytes
        The body as it arrives.
    declared : str or None
        The header ``Content-Length``.
    limit : int
        Largest number of bytes.

    Returns
    -------
    bytes
        The whole body.

    Raises
    ------
    BodyTooLargeError
        Where it is, or is declared to be, larger than ``limit``.
    MalformedError
        Where ``declared`` is not a number.
    """
    message = f"the body has more than {limit} bytes"
    if declared is not None:
        if not (declared.isascii() and declared.isdigit()):
            raise MalformedError("Content-Length is not a number")
        if len(declared) > 18 or int(declared) > limit:
            raise BodyTooLargeError(message)
    body = bytearray()
    async for chunk in chunks:
        body += chunk
        if len(body) > limit:
            raise BodyTooLargeError(message)
    return bytes(body)


def _check_media_type(header: str | None) -> None:
    """Accept JSON by any of its names, and a body that does not say what it is."""
    if header is None:
        return
    kind = header.split(";")[0].strip().lower()
    if kind != "application/json" and not (
        kind.startswith("application/") and kind.endswith("+json")
    ):
        raise UnsupportedMediaTypeError("Content-Type must be application/json")


class BodyOf(Generic[T]):
    """FastAPI dependency that reads a request body of one type: the request, and its bytes.

    FastAPI's own parsing runs on the event loop, takes NaN and repeated members, and does not
    bound the body. The OpenAPI document shows the type by itself (`service.openapi`).

    Parameters
    ----------
    model : type
        A subclass of `Validated`.
    """

    def __init__(self, model: type[T]) -> None:
        self.model = model

    async def __call__(self, request: Request) -> tuple[T, bytes]:
        """Read, bounded; then parse and validate in a thread.

        Raises
        ------
        UnsupportedMediaTypeError, BodyTooLargeError, MalformedError, InvalidInputError
            Each as its name says.
        """
        _check_media_type(request.headers.get("content-type"))
        shared = shared_of(request)
        raw = await read_limited(
            request.stream(), request.headers.get("content-length"), shared.settings.max_body_bytes
        )
        parsed = await anyio.to_thread.run_sync(
            parse_document, self.model, raw, limiter=shared.threads
        )
        return parsed, raw
