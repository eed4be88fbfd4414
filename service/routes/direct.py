"""Routes that are answered without FastAPI's way to them.

FastAPI describes them, and knows their parameters; its layers and its search for a route and for
what the route needs would take longer than the estimate of a frame.
"""

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from fastapi.routing import APIRoute

__all__ = ["DirectRoute"]


class DirectRoute(APIRoute):
    """A route whose answer `service.border.methods` asks for; parameters of its path are texts."""

    async def answer(self, request: Request) -> Response:
        """Return the answer to a request.

        Raises
        ------
        HybridTofError
            As the route's own function.
        """
        raise NotImplementedError

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request that came by FastAPI's way."""
        return self.answer
