"""Whether the service lives, and whether it takes work."""

from typing import Literal

from fastapi import APIRouter, Request
from pydantic import BaseModel

from service.errors import BusyError
from service.problems import problem_responses
from service.shared import shared_of

__all__ = ["Health", "router"]

router = APIRouter(prefix="/health", tags=["health"])


class Health(BaseModel):
    """The good answer; the other one is a problem.

    ``warming``: machine code is being made; answers are the same meanwhile, only slower.
    """

    status: Literal["ok", "warming"] = "ok"


@router.get("/live")
async def live() -> Health:
    """Answer as long as the process can answer at all."""
    return Health()


@router.get("/ready", responses=problem_responses(503))
async def ready(request: Request) -> Health:
    """Answer 503 while the service starts or ends."""
    if not shared_of(request).jobs.open:
        raise BusyError("the service is starting or ending")
    warming = shared_of(request).warming
    return Health(status="warming" if warming is not None and warming.going else "ok")
