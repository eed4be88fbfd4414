"""The outermost application: it lets requests in, dresses what goes out, and tells of both."""

import asyncio
import time
from collections.abc import Sequence

from fastapi import APIRouter, FastAPI
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.border.authorities import Authorities
from service.border.held import Held, Room
from service.border.keys import KeyRing
from service.border.methods import Methods
from service.border.traces import REQUEST_ID, Told, Traces, request_id
from service.errors import UnauthorizedError
from service.problems import internal, response_of
from simulator.errors import HybridTofError

__all__ = ["WITHOUT_KEY", "Gate", "install"]

# no answer is a page: nothing in it may run, be framed, be guessed at or be kept
_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)
_BLOCK = 2**16
# with which a WebSocket is closed
_POLICY = 1008

WITHOUT_KEY = frozenset({"/health/live", "/health/ready"})
"""Who starts and stops the service must see whether it lives, and has no key."""


async def _unless(out: asyncio.Event, receive: Receive) -> Message:
    """Receive a message, or the end of the connection as soon as its key is known to be none."""
    coming, ending = asyncio.ensure_future(receive()), asyncio.ensure_future(out.wait())
    try:
        await asyncio.wait((coming, ending), return_when=asyncio.FIRST_COMPLETED)
        return coming.result() if coming.done() else {"type": "http.disconnect"}
    finally:
        coming.cancel()
        ending.cancel()


class Gate:
    """An ASGI application around another.

    Parameters
    ----------
    app : ASGI application
        Which answers what is let in.
    authorities : Authorities
        By which names, and from whose pages, it may be asked.
    keys : KeyRing or None
        Who may ask; None: everybody who can reach it.
    traces : Traces
        Is told of every request.
    room : Room
        For bodies and answers.
    """

    def __init__(
        self,
        app: ASGIApp,
        authorities: Authorities,
        keys: KeyRing | None,
        traces: Traces,
        room: Room,
    ) -> None:
        self._app = app
        self._authorities = authorities
        self._keys = keys
        self._traces = traces
        self._room = room

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "http":
            await self._request(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        name = request_id(Headers(scope=scope).get("x-request-id"))
        before = REQUEST_ID.set(name)
        began, status, sent = time.perf_counter(), None, 0
        out = False

        async def receive_known() -> Message:
            nonlocal out
            message = await receive()
            out = message["type"] == "websocket.receive" and self._out(scope)
            return {"type": "websocket.disconnect", "code": _POLICY} if out else message

        async def send_counted(message: Message) -> None:
            nonlocal status, sent
            if out and message["type"] == "websocket.close":
                message = dict(message) | {"code": _POLICY}
            if message["type"] == "websocket.http.response.start":
                status = message["status"]
            elif status is None:
                status = 101 if message["type"] == "websocket.accept" else 403
            sent += len(message.get("text") or message.get("body") or b"")
            await send(message)

        self._traces.open.inc()
        try:
            self._let_in(scope)
            await self._app(scope, receive_known, send_counted)
        except HybridTofError as error:
            if "websocket.http.response" in scope.get("extensions", {}):
                await response_of(error)(scope, receive, send_counted)
            else:
                await send_counted({"type": "websocket.close", "code": _POLICY})
        finally:
            self._traces.open.dec()
            self._traces.tell(scope, Told(status, sent, time.perf_counter() - began))
            REQUEST_ID.reset(before)

    def _let_in(self, scope: Scope) -> None:
        """Refuse a request, or note whose it is."""
        self._authorities.check(Headers(scope=scope))
        if self._keys is not None and scope["path"] not in WITHOUT_KEY:
            scope["hybridtof.client"] = self._owner(self._keys, scope)

    @staticmethod
    def _owner(keys: KeyRing, scope: Scope) -> str:
        given = Headers(scope=scope).getlist("authorization")
        return keys.owner(given[0] if len(given) == 1 else None)

    def _out(self, scope: Scope) -> bool:
        """Tell whether a key was revoked since it was let in: some connections last for days."""
        if self._keys is None or scope["path"] in WITHOUT_KEY:
            return False
        try:
            self._owner(self._keys, scope)
        except UnauthorizedError:
            return True
        return False

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        name = request_id(Headers(scope=scope).get("x-request-id"))
        before = REQUEST_ID.set(name)
        began, status, sent = time.perf_counter(), None, 0
        # an answer without a stated length may last for days
        begun, lasting, out = False, False, asyncio.Event()

        async def receive_known() -> Message:
            nonlocal begun
            if self._keys is None or not begun:
                begun = True
                return await receive()
            message = await _unless(out, receive)
            if lasting and message["type"] == "http.request" and self._out(scope):
                out.set()
            return {"type": "http.disconnect"} if out.is_set() else message

        held = scope["hybridtof.held"] = Held(self._room)

        async def send_dressed(message: Message) -> None:
            nonlocal status, sent, lasting
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = list(message.get("headers", ()))
                known = {header.lower() for header, _ in headers}
                lasting = b"content-length" not in known
                headers += [pair for pair in _HEADERS if pair[0] not in known]
                headers.append((b"x-request-id", name.encode("ascii")))
                await send(dict(message) | {"headers": headers})
                return
            body = message.get("body", b"")
            if lasting and sent and body and self._out(scope):
                out.set()
            if out.is_set():
                return
            held.answer(len(body))
            sent += len(body)
            # each block waits until the client has read most of those before it
            for start in range(0, len(body) - _BLOCK, _BLOCK):
                block = body[start : start + _BLOCK]
                await send({"type": "http.response.body", "body": block, "more_body": True})
            rest = (len(body) - 1) // _BLOCK * _BLOCK if body else 0
            await send(dict(message) | {"body": body[rest:]})
            if message.get("more_body", False):
                held.sent(len(body))

        self._traces.open.inc()
        try:
            self._let_in(scope)
            await self._app(scope, receive_known, send_dressed)
            if out.is_set():
                await send({"type": "http.response.body", "body": b""})
        except HybridTofError as error:  # of the border: those of the routes are answered there
            await response_of(error)(scope, receive, send_dressed)
        except Exception as error:
            # Starlette has answered, where it could, and written it down: the server need not again
            if status is None:
                await internal(error)(scope, receive, send_dressed)
        finally:
            self._traces.open.dec()
            held.release()
            self._traces.tell(scope, Told(status, sent, time.perf_counter() - began))
            REQUEST_ID.reset(before)


def install(
    app: FastAPI,
    routers: Sequence[APIRouter],
    authorities: Authorities,
    keys: KeyRing | None,
    traces: Traces,
    room: Room,
) -> None:
    """Put the gate before an application: outside of all that FastAPI answers by itself.

    Parameters
    ----------
    routers : sequence of APIRouter
        Its routers.
    authorities, keys, traces, room
        See `Gate`.
    """
    build = app.build_middleware_stack
    routes = [*app.routes, *(route for router in routers for route in router.routes)]

    def built() -> ASGIApp:
        return Gate(Methods(build(), routes), authorities, keys, traces, room)

    app.build_middleware_stack = built  # type: ignore[method-assign]  # nothing is outside of it
