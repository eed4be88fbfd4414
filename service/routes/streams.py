"""Streams: frames in and ranges out, a line each, for as long as there are frames."""

import asyncio
import math
import re
from collections.abc import AsyncIterable, AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from service.answers.streams import StreamLine, StreamPage, StreamResponse, stream_of
from service.bodies import BodyOf, check_media_type, read_limited
from service.errors import SlowClientError
from service.messages.message import Message
from service.messages.streaming import (
    LINES,
    as_messages,
    limits_of_tracker,
    lines_type,
    message_for,
)
from service.problems import problem_responses, response_of
from service.requests import StreamRequest
from service.routes.direct import DirectRoute
from service.routes.resources import Cursor, LastEventId, answered, event_of, place_of
from service.shared import client_of, shared_of
from service.store.stream_record import StreamRecord
from service.streams.answered import encoded, error_of
from service.streams.lines import ended, lines_in
from service.streams.producer import lines_of
from simulator.errors import HybridTofError

__all__ = ["router"]

router = APIRouter(prefix="/v1/streams", tags=["streams"])
Body = Annotated[tuple[StreamRequest, bytes], Depends(BodyOf(StreamRequest))]

_KINDS = re.compile(r"application/(x-ndjson|ndjson|jsonl|json-seq|json|x-jsonlines)")
_QUIET_S = 60.0


@router.post(
    "",
    status_code=201,
    response_model=None,
    responses={201: {"model": StreamResponse}, **problem_responses(400, 413, 415, 422, 503)},
)
async def create(request: Request, body: Body) -> Response:
    """Make a stream: a sensor, a scene, and how its objects move."""
    streams = shared_of(request).streams
    record = await streams.create(body[1], client_of(request))
    headers = {"Location": f"/v1/streams/{record.id}"}
    return answered(stream_of(record, streams.status(record)), 201, headers)


@router.get(
    "",
    response_model=None,
    responses={200: {"model": StreamPage}, **problem_responses(400, 422)},
)
async def page(
    request: Request,
    cursor: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> Response:
    """List streams, the newest first; ``next_cursor`` is null on the last page."""
    streams = shared_of(request).streams
    records = await streams.page(place_of(cursor), limit + 1, client_of(request))
    more = str(records[limit - 1].arrival) if len(records) > limit else None
    items = [stream_of(record, streams.status(record)) for record in records[:limit]]
    return answered({"items": items, "next_cursor": more})


@router.get(
    "/{stream_id}",
    response_model=None,
    responses={200: {"model": StreamResponse}, **problem_responses(404)},
)
async def get(request: Request, stream_id: str) -> Response:
    """Return a stream as it stands: counts, health, its last answer."""
    streams = shared_of(request).streams
    record = await streams.get(stream_id, client_of(request))
    return answered(stream_of(record, streams.status(record)))


@router.delete(
    "/{stream_id}", status_code=204, response_model=None, responses=problem_responses(404)
)
async def delete(request: Request, stream_id: str) -> Response:
    """Forget a stream; a client that sends to it is told so."""
    await shared_of(request).streams.delete(stream_id, client_of(request))
    return Response(status_code=204)


async def _followed(
    request: Request,
    stream_id: str,
    last_event_id: LastEventId = None,
) -> AsyncIterator[tuple[StreamRecord, str]]:
    """Refuse before the events begin, where there is nothing to follow."""
    after = event_of(last_event_id)
    streams = shared_of(request).streams
    record = await streams.get(stream_id, client_of(request))
    if streams.status(record) == "expired" and record.number <= after:
        raise HTTPException(204)  # so that a browser asks no more

    async def changes() -> AsyncIterator[tuple[StreamRecord, str]]:
        async for record in streams.follow(stream_id, after, client_of(request)):
            yield record, streams.status(record)

    return changes()


@router.get(
    "/{stream_id}/events",
    response_class=EventSourceResponse,
    responses={
        204: {"description": "It has expired, and that event was seen"},
        **problem_responses(404),
    },
)
async def events(
    changes: Annotated[AsyncIterator[tuple[StreamRecord, str]], Depends(_followed)],
) -> AsyncIterable[ServerSentEvent]:
    """Tell how a stream stands after every change; those in quick succession are told as one."""
    async for record, status in changes:
        yield ServerSentEvent(data=stream_of(record, status), id=str(record.number))


class _Answers(Response):
    """Answers as they are made, while lines still come."""

    media_type = LINES

    def __init__(self, request: Request, stream_id: str, message: Message | None) -> None:
        super().__init__()
        self._request, self._id, self._message = request, stream_id, message

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002
        request, begun = self._request, False
        limits = (0.0, math.inf)

        async def begin() -> None:
            nonlocal begun
            begun = True
            kind = lines_type(self._message)
            headers = [(b"content-type", kind.encode()), (b"vary", b"accept")]
            await send({"type": "http.response.start", "status": 200, "headers": headers})

        async def answer(body: bytes) -> None:
            if not begun:
                await begin()
            if self._message is not None:
                lines = lines_in(body)
                body = ended(await asyncio.to_thread(as_messages, self._message, limits, lines))
            await send({"type": "http.response.body", "body": body, "more_body": True})

        shared = shared_of(request)
        client, at_once = client_of(request), self._at_once()
        try:
            opened = shared.streams.producing(self._id, client, _QUIET_S, lasting=not at_once)
            async with opened as producer:
                limits = limits_of_tracker(producer.model.base)
                if at_once:
                    await producer.run(lines_of(self._whole()), answer)
                else:
                    # who sends without an end reads meanwhile
                    await begin()
                    await producer.run(lines_of(request.stream()), answer)
        except HybridTofError as error:
            if not begun:
                raise
            await answer(encoded({"sequence": None, "error": error_of(error)}) + b"\n")
        if not begun:
            await begin()
        await send({"type": "http.response.body", "body": b""})

    def _at_once(self) -> bool:
        """Tell whether the body has an end that is near.

        Most clients read nothing before they have sent everything: answered meanwhile, both sides
        would wait for each other.
        """
        declared = self._request.headers.get("content-length", "")
        most = shared_of(self._request).settings.max_body_bytes
        known = declared.isascii() and declared.isdigit() and len(declared) < 18
        return known and int(declared) <= most

    async def _whole(self) -> AsyncIterator[bytes]:
        request, settings = self._request, shared_of(self._request).settings
        declared = request.headers.get("content-length")
        held = request.scope["hybridtof.held"]
        most, client_s = settings.max_body_bytes, settings.client_s
        yield await read_limited(request.stream(), declared, most, held, client_s)


class _Frames(DirectRoute):
    """A batch of lines takes less time than FastAPI's way to it."""

    async def answer(self, request: Request) -> Response:
        """See `DirectRoute`."""
        return await frames(request, request.path_params["stream_id"])


async def frames(request: Request, stream_id: str) -> Response:
    """Answer frames line by line; a number that was answered is answered as before.

    By ``Accept`` a line has a message of ROS 2 or MAVLink in place of its numbers.
    """
    check_media_type(request.headers, _KINDS, LINES)
    return _Answers(request, stream_id, message_for(",".join(request.headers.getlist("accept"))))


router.add_api_route(
    "/{stream_id}/frames",
    frames,
    methods=["POST"],
    route_class_override=_Frames,
    status_code=200,
    response_model=None,
    response_class=_Answers,
    responses={
        200: {"description": "One answer a line, in order", "model": StreamLine},
        **problem_responses(404, 406, 408, 409, 410, 413, 415, 503),
    },
    openapi_extra={
        "requestBody": {
            "required": True,
            "description": "One frame a line: columns in the singular, `sequence`, and whatever is "
            "to be passed through. With a Content-Length the batch is answered when it is there; "
            "without, line by line as they come, for as long as they come.",
            "content": {LINES: {"schema": {"type": "object"}}},
        }
    },
)


@router.websocket("/{stream_id}/live")
async def live(socket: WebSocket, stream_id: str) -> None:
    """Answer frames that come as text messages, each by a message."""
    socket.scope["hybridtof.route"] = router.prefix + "/{stream_id}/live"
    shared = shared_of(socket)
    client_s = shared.settings.client_s

    async def answer(text: bytes) -> None:
        for line in lines_in(text):
            try:
                async with asyncio.timeout(client_s):
                    await socket.send_text(line.decode())
            except TimeoutError:
                raise SlowClientError("the answers are not read") from None

    accepted = False
    try:
        async with shared.streams.producing(stream_id, client_of(socket)) as producer:
            await socket.accept()
            accepted = True
            await producer.run(_messages(socket), answer)
        await socket.close()
    except WebSocketDisconnect:
        pass
    except HybridTofError as error:
        if not accepted:
            await socket.send_denial_response(response_of(error))
            return
        try:
            await answer(encoded({"sequence": None, "error": error_of(error)}) + b"\n")
            await socket.close(1013, error_of(error)["title"])
        except (WebSocketDisconnect, SlowClientError):
            pass


async def _messages(socket: WebSocket) -> AsyncIterator[list[bytes | None]]:
    """Yield the lines of messages; the end of a message is the end of a line."""

    async def said() -> AsyncIterator[bytes]:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            yield (message["bytes"] if text is None else text.encode()) + b"\n"

    async for lines in lines_of(said()):
        yield lines
