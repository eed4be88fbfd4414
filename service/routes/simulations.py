"""Frames with their truth, from a scene, a trajectory and a seed."""

import secrets
from typing import Annotated, Any

import anyio.to_thread
import numpy as np
import pydantic_core
from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.bodies import body_of, openapi_body
from service.checks import system
from service.problems import problem_responses
from service.schemas import SimulationRequest, SimulationResponse
from service.state import state_of
from simulator.errors import RefusedError
from simulator.simulate import simulate

__all__ = ["answer", "router"]

router = APIRouter(prefix="/v1/simulations", tags=["simulations"])
Body = Annotated[tuple[SimulationRequest, bytes], Depends(body_of(SimulationRequest))]


def answer(request: SimulationRequest) -> dict[str, Any]:
    """Simulate.

    Parameters
    ----------
    request : SimulationRequest
        Sensor, scene, trajectory and seed.

    Returns
    -------
    dict
        ``frames`` (columns), ``truth`` (``range_m``, null where the scene is empty, and
        ``parameters``, the values of the unknowns that were drawn) and ``seed``.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    RefusedError
        Where readings of this scene are beyond what a number can hold.
    """
    sensor, scene = system(request)
    seed = secrets.randbelow(2**53) if request.seed is None else request.seed
    simulation = simulate(sensor, scene, request.trajectory, seed)
    if not np.isfinite(simulation.frames.readings).all():
        message = "the readings of this scene overflow; bring gain, ranges and noise nearer to 1"
        raise RefusedError(message)
    return {
        "frames": simulation.frames.to_columns(sensor),
        "truth": {"range_m": simulation.range_m.tolist(), "parameters": simulation.parameters},
        "seed": seed,
    }


@router.post(
    "",
    response_model=None,
    responses={200: {"model": SimulationResponse}, **problem_responses(400, 413, 415, 422)},
    openapi_extra=openapi_body(SimulationRequest),
)
async def create(request: Request, body: Body) -> Response:
    """Simulate frames; unknowns of the scene are drawn from their priors, once."""
    limiter = state_of(request).threads

    def content() -> bytes:
        return pydantic_core.to_json(answer(body[0]), inf_nan_mode="null")

    text = await anyio.to_thread.run_sync(content, limiter=limiter)
    return Response(text, media_type="application/json")
