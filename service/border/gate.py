"""The outermost application: it lets requests in, and dresses what goes out."""

from collections.abc import Awaitable, Callable, Sequence

from fastapi import APIRouter, FastAPI
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.border.authorities import Authorities
from service.border.methods import Methods
from service.problems import response_of
from simulator.errors import HybridTofError

__all__ = ["Gate", "install"]

# no answer is a page: nothing in it may run, be framed, be guessed at or be kept
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Gate:
    """An ASGI application around another.

    Parameters
    ----------
    app : ASGI application
        Which answers what is let in.
    authorities : Authorities
        By which names, and from whose pages, it may be asked.
    """

    def __init__(self, app: ASGIApp, authorities: Authorities) -> None:
        self._app = app
        self._authorities = authorities

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        try:
            self._authorities.check(Headers(scope=scope))
            await self._app(scope, receive, send_dressed)
        except HybridTofError as error:  # of the border: those of the routes are answered there
            await _refuse(error)(scope, receive, send_dressed)


def _refuse(error: HybridTofError) -> Callable[[Scope, Receive, Send], Awaitable[None]]:
    async def refusal(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await response_of(error)(scope, receive, send)

    return refusal


def install(app: FastAPI, routers: Sequence[APIRouter], authorities: Authorities) -> None:
    """Put the gate before an application: outside of all that FastAPI answers by itself.

    Parameters
    ----------
    app : FastAPI
        The application.
    routers : sequence of APIRouter
        Its routers.
    authorities : Authorities
        See `Gate`.
    """
    build = app.build_middleware_stack
    routes = [*app.routes, *(route for router in routers for route in router.routes)]

    def built() -> ASGIApp:
        return Gate(Methods(build(), routes), authorities)

    app.build_middleware_stack = built  # type: ignore[method-assign]  # nothing is outside of it
