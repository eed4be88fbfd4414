"""UM-Bridge 1.0: models over HTTP for clients of uncertainty quantification."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service import umbridge
from service.bodies import body_of
from service.errors import OverdueError
from service.shared import shared_of

__all__ = ["router"]

# a protocol of its own, which describes itself
router = APIRouter(prefix="/umbridge", tags=["umbridge"], include_in_schema=False)


def _said(status: int, body: bytes) -> Response:
    return Response(body, status, media_type="application/json")


@router.get("/Info")
async def info() -> Response:
    """Return the models."""
    return _said(200, umbridge.INFO)


async def ask(request: Request) -> Response:
    """Answer what clients post; they do not say that it is JSON."""
    raw = await body_of(request)
    operation = request.scope["path"].rpartition("/")[2]
    try:
        answer = await shared_of(request).processes.run(request, umbridge.answer, operation, raw)
    except OverdueError as error:
        answer = umbridge.refusal("InvalidInput", f"{error}: send fewer frames")
    return _said(*answer)


async def refuse(request: Request) -> Response:  # noqa: ARG001  (whatever it says)
    """Say that there is no such thing."""
    message = f"these models have {', '.join(umbridge.OPERATIONS)}"
    return _said(*umbridge.refusal("UnsupportedFeature", message))


for name in umbridge.OPERATIONS:
    router.add_api_route(f"/{name}", ask, methods=["POST"])
for name in umbridge.UNSUPPORTED:
    router.add_api_route(f"/{name}", refuse, methods=["POST"])
