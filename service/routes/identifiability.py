"""What frames would tell of a scene, before they are taken."""

import dataclasses
from typing import Annotated

import anyio.to_thread
import pydantic_core
from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.answers.identifiability import IdentifiabilityResponse, identifiability_of
from service.bodies import BodyOf
from service.problems import problem_responses
from service.requests import IdentifiabilityRequest
from service.shared import shared_of

__all__ = ["router"]

router = APIRouter(prefix="/v1/identifiability", tags=["identifiability"])
Body = Annotated[tuple[IdentifiabilityRequest, bytes], Depends(BodyOf(IdentifiabilityRequest))]


@router.post(
    "",
    response_model=None,
    responses={200: {"model": IdentifiabilityResponse}, **problem_responses(400, 413, 415, 422)},
)
async def create(request: Request, body: Body) -> Response:
    """Return rank, Cramer-Rao bounds, and a status with a reason for every unknown."""
    limiter = shared_of(request).threads

    def content() -> bytes:
        return pydantic_core.to_json(dataclasses.asdict(identifiability_of(body[0])))

    text = await anyio.to_thread.run_sync(content, limiter=limiter)
    return Response(text, media_type="application/json")
