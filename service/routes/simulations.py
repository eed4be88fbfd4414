"""Frames with their truth, from a scene, a trajectory and a seed."""

from typing import Annotated

import anyio.to_thread
import pydantic_core
from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.answers.simulations import SimulationResponse, simulation_of
from service.bodies import BodyOf
from service.problems import problem_responses
from service.requests import SimulationRequest
from service.shared import shared_of

__all__ = ["router"]

router = APIRouter(prefix="/v1/simulations", tags=["simulations"])
Body = Annotated[tuple[SimulationRequest, bytes], Depends(BodyOf(SimulationRequest))]


@router.post(
    "",
    response_model=None,
    responses={200: {"model": SimulationResponse}, **problem_responses(400, 413, 415, 422)},
)
async def create(request: Request, body: Body) -> Response:
    """Simulate frames; unknowns of the scene are drawn from their priors, once."""
    limiter = shared_of(request).threads

    def content() -> bytes:
        return pydantic_core.to_json(simulation_of(body[0]))

    text = await anyio.to_thread.run_sync(content, limiter=limiter)
    return Response(text, media_type="application/json")
