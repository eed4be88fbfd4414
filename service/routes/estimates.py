"""Deterministic estimates, at once."""

from typing import Annotated

import anyio.to_thread
from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from inference.estimate import estimate
from service.answers.estimates import EstimatesResponse, encode_estimates
from service.bodies import BodyOf
from service.checked_system import checked_frames
from service.problems import problem_responses
from service.requests import EstimateRequest
from service.shared import shared_of

__all__ = ["answer", "router"]

router = APIRouter(prefix="/v1/estimates", tags=["estimates"])
Body = Annotated[tuple[EstimateRequest, bytes], Depends(BodyOf(EstimateRequest))]


def answer(request: EstimateRequest) -> bytes:
    """Estimate and encode.

    Parameters
    ----------
    request : EstimateRequest
        Sensor, scene, frames and techniques.

    Returns
    -------
    bytes
        JSON as in docs/http.md, estimates.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    """
    sensor, scene, frames = checked_frames(request.sensor, request.scene, request.frames)
    return encode_estimates(estimate(sensor, scene, frames, request.techniques))


@router.post(
    "",
    response_model=None,
    responses={200: {"model": EstimatesResponse}, **problem_responses(400, 413, 415, 422)},
)
async def create(request: Request, body: Body) -> Response:
    """Return all physical roots of every frame."""
    limiter = shared_of(request).threads
    content = await anyio.to_thread.run_sync(answer, body[0], limiter=limiter)
    return Response(content, media_type="application/json")
