"""Methods that HTTP gives to every resource: HEAD where GET is, OPTIONS, a 405 that says which."""

import functools
import re
from collections.abc import Sequence

import anyio
from starlette.requests import Request
from starlette.routing import BaseRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import MethodError
from service.routes.direct import DirectRoute

__all__ = ["Methods"]


class Methods:
    """An ASGI application that answers HEAD and OPTIONS for another.

    Parameters
    ----------
    app : ASGI application
        Which has the routes.
    routes : sequence of BaseRoute
        Those; what is mounted keeps its own manners.
    """

    def __init__(self, app: ASGIApp, routes: Sequence[BaseRoute]) -> None:
        self._app = app
        self._routes = [
            (pattern, path, frozenset(methods))
            for route in routes
            if (pattern := getattr(route, "path_regex", None)) is not None
            and (path := getattr(route, "path", None)) is not None
            and (methods := getattr(route, "methods", None))
        ]

        self._direct: dict[tuple[str, str], DirectRoute] = {
            (route.path, method): route
            for route in routes
            if isinstance(route, DirectRoute)
            for method in route.methods or ()
        }
        # most requests are for a path without parameters
        self._of_parameters = functools.lru_cache(maxsize=1024)(self._found)
        self._fixed = {path: self._found(path) for _, path, _ in self._routes if "{" not in path}

    def _known(self, path: str) -> tuple[str, frozenset[str]] | None:
        return self._fixed[path] if path in self._fixed else self._of_parameters(path)

    def _found(self, path: str) -> tuple[str, frozenset[str]] | None:
        """Return the template of a path and all its methods; None where no route has it."""
        found: set[str] = set()
        template = None
        for pattern, shape, methods in self._routes:
            if re.match(pattern, path):
                found |= methods
                template = template or shape
        return None if template is None else (template, frozenset(found))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer by itself, or let the routes answer.

        Raises
        ------
        MethodError
            Where no route of the path takes the method.
        HybridTofError
            Of a route that is answered directly.
        """
        known = self._known(scope["path"]) if scope["type"] == "http" else None
        if known is None:
            await self._app(scope, receive, send)
            return
        scope["hybridtof.route"], methods = known
        method = scope["method"]
        direct = self._direct.get((scope["hybridtof.route"], method))
        if direct is not None:
            match = direct.path_regex.match(scope["path"])
            scope["path_params"] = {} if match is None else match.groupdict()
            response = await direct.answer(Request(scope, receive, send))
            await response(scope, receive, send)
            return
        allowed = methods | {"OPTIONS"} | ({"HEAD"} if "GET" in methods else set())
        allow = ", ".join(sorted(allowed))
        if method == "OPTIONS":
            headers = [(b"allow", allow.encode("ascii"))]
            await send({"type": "http.response.start", "status": 204, "headers": headers})
            await send({"type": "http.response.body", "body": b""})
        elif method == "HEAD" and "GET" in methods:
            await _head(self._app, scope, receive, send)
        elif method not in methods:
            raise MethodError(f"this takes {allow}", allow)
        else:
            await self._app(scope, receive, send)


async def _head(app: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
    """Ask with GET, and leave it when the headers are there: a body may have no end."""
    with anyio.CancelScope() as asking:

        async def send_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                await send(message)
                await send({"type": "http.response.body", "body": b""})
                asking.cancel()

        await app(dict(scope) | {"method": "GET"}, receive, send_headers)
