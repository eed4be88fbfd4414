"""Frames with their truth, from a scene, a trajectory and a seed."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.answers.simulations import SimulationResponse, simulation_of
from service.bodies import BodyOf
from service.caps import frames_within
from service.json_text import encode
from service.problems import problem_responses
from service.requests import SimulationRequest
from service.shared import shared_of

__all__ = ["answer", "router"]

router = APIRouter(prefix="/v1/simulations", tags=["simulations"])
Body = Annotated[tuple[SimulationRequest, bytes], Depends(BodyOf(SimulationRequest))]


def answer(request: SimulationRequest) -> bytes:
    """Simulate and encode; see `service.answers.simulations.simulation_of`."""
    return encode(simulation_of(request))


@router.post(
    "",
    response_model=None,
    responses={200: {"model": SimulationResponse}, **problem_responses(400, 413, 415, 422, 503)},
)
async def create(request: Request, body: Body) -> Response:
    """Simulate frames; unknowns of the scene are drawn from their priors, once."""
    shared = shared_of(request)
    frames = frames_within(shared.settings, body[0].trajectory)
    text = await shared.lane(frames).run(request, answer, body[0])
    return Response(text, media_type="application/json")
