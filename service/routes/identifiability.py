"""What frames would tell of a scene, before they are taken."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.answers.identifiability import IdentifiabilityResponse, identifiability_of
from service.bodies import BodyOf
from service.json_text import encode
from service.problems import problem_responses
from service.requests import IdentifiabilityRequest
from service.shared import shared_of

__all__ = ["answer", "router"]

router = APIRouter(prefix="/v1/identifiability", tags=["identifiability"])
Body = Annotated[tuple[IdentifiabilityRequest, bytes], Depends(BodyOf(IdentifiabilityRequest))]


# what one range costs here, in frames of an estimate
_COST = 10


def answer(request: IdentifiabilityRequest) -> bytes:
    """Foresee and encode; see `service.answers.identifiability.identifiability_of`."""
    return encode(identifiability_of(request))


@router.post(
    "",
    response_model=None,
    responses={
        200: {"model": IdentifiabilityResponse},
        **problem_responses(400, 413, 415, 422, 503),
    },
)
async def create(request: Request, body: Body) -> Response:
    """Return rank, Cramer-Rao bounds, and a status with a reason for every unknown."""
    lane = shared_of(request).lane(_COST * len(body[0].ranges_m))
    text = await lane.run(request, answer, body[0])
    return Response(text, media_type="application/json")
