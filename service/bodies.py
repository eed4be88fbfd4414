"""Request bodies: bytes, bounded; then JSON; then a validated request."""

import asyncio
import re
from collections.abc import AsyncIterator
from email.message import Message
from typing import Generic, TypeVar

from fastapi import Request
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect

from service.border.held import Held
from service.column_names import with_remedy
from service.errors import (
    BodyTooLargeError,
    ClientGoneError,
    MalformedError,
    SlowClientError,
    UnsupportedMediaTypeError,
)
from service.known_systems import read_system
from service.shared import TINY_BYTES, shared_of
from service.strict_json import SHORT, check_bulk, decode
from simulator.errors import InvalidInputError
from simulator.validated import Validated

__all__ = ["BodyOf", "body_of", "check_media_type", "parse_document", "read_limited"]

T = TypeVar("T", bound=Validated)

_JSON = re.compile(r"application/(?:json|[a-z0-9!#$&^_.+-]+\+json)")
_BLOCK = 2**16
_CHARSETS = frozenset({"utf-8", "utf8", "us-ascii"})


def parse_document(model: type[T], raw: bytes) -> T:
    """Read one JSON document as a validated type.

    Parameters
    ----------
    model : type
        A subclass of `Validated`.
    raw : bytes
        JSON text.

    Raises
    ------
    MalformedError
        Where it is not JSON.
    InvalidInputError
        With a pointer for each offending field.
    """
    data = decode(raw)
    if raw.count(b",") >= SHORT:  # else nothing in it is long
        check_bulk(data)
    try:
        return read_system(model, data)
    except InvalidInputError as error:
        frames = data.get("frames") if isinstance(data, dict) else None
        raise with_remedy(error, frames, "/frames") from None


async def read_limited(
    chunks: AsyncIterator[bytes],
    declared: str | None,
    limit: int,
    held: Held,
    client_s: float = 10.0,
) -> bytes:
    """Collect a body, and stop as soon as it is too large or too slow.

    Parameters
    ----------
    chunks : async iterator of bytes
        The body as it arrives.
    declared : str or None
        The header ``Content-Length``.
    limit : int
        Largest number of bytes.
    held : Held
        Holds the bytes.
    client_s : float
        Time for the whole body [s], and a second more for every megabyte that is there.

    Raises
    ------
    BodyTooLargeError
        Where it is, or is declared to be, larger than ``limit``.
    MalformedError
        Where ``declared`` is not a number.
    BusyError
        Where there is no room for it among the bodies of others.
    SlowClientError
        Where it takes too long.
    ClientGoneError
        Where it ends before its end.
    """
    message = f"the body has more than {limit} bytes"
    if declared is not None:
        if not (declared.isascii() and declared.isdigit()):
            raise MalformedError("Content-Length is not a number")
        if len(declared) > 18 or int(declared) > limit:
            raise BodyTooLargeError(message)
    body = bytearray()
    begun = asyncio.get_running_loop().time()
    try:
        async with asyncio.timeout_at(begun + client_s) as clock:
            async for chunk in chunks:
                if len(body) + len(chunk) > limit:
                    raise BodyTooLargeError(message)
                held.take(len(chunk))
                body += chunk
                if len(body) > _BLOCK:  # of less the time is none
                    clock.reschedule(begun + client_s + len(body) / 1e6)
    except TimeoutError:
        raise SlowClientError(f"of the body {len(body)} bytes have come, too slowly") from None
    except ClientDisconnect:
        raise ClientGoneError("the client hung up within the body") from None
    return bytes(body)


def check_media_type(
    headers: Headers, kinds: re.Pattern[str] = _JSON, name: str = "application/json"
) -> None:
    """Accept JSON in UTF-8 by any of its names, and nothing that does not say that it is.

    A page of somebody else can send forms and plain text without asking, but not this.

    Parameters
    ----------
    headers : Headers
        Of the request.
    kinds : Pattern
        Other media types than those of JSON.
    name : str
        The one that is told to the client.

    Raises
    ------
    UnsupportedMediaTypeError
        Where the body is declared to be something else, in another charset or compressed, or is
        not declared.
    """
    given = headers.getlist("content-type")
    if given == ["application/json"] and "content-encoding" not in headers:
        return
    message = Message()
    message["Content-Type"] = given[0] if given else "none"
    kind = message.get_content_type()
    if len(given) != 1 or not kinds.fullmatch(kind):
        raise UnsupportedMediaTypeError(f"Content-Type must be {name}", name)
    charset = message.get_content_charset("utf-8")
    if charset not in _CHARSETS:
        raise UnsupportedMediaTypeError("the charset must be utf-8", name)
    codings = ",".join(headers.getlist("content-encoding")).lower().split(",")
    if {coding.strip() for coding in codings} - {"", "identity"}:
        message_of = "the body must not be compressed: no Content-Encoding"
        raise UnsupportedMediaTypeError(message_of, name)


async def body_of(request: Request) -> bytes:
    """Collect the body of a request within the service's bounds; raises as `read_limited`."""
    shared = shared_of(request)
    return await read_limited(
        request.stream(),
        request.headers.get("content-length"),
        shared.settings.max_body_bytes,
        request.scope["hybridtof.held"],
        shared.settings.client_s,
    )


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
        """Read, bounded; then parse and validate, in a thread where that may take long.

        Raises
        ------
        UnsupportedMediaTypeError, BodyTooLargeError, MalformedError, InvalidInputError
            Each as its name says.
        """
        check_media_type(request.headers)
        raw = await body_of(request)
        if len(raw) <= TINY_BYTES:
            return parse_document(self.model, raw), raw
        parsing = shared_of(request).parsing
        return await parsing.run(request, parse_document, self.model, raw), raw
