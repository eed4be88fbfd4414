"""Deterministic estimates, at once."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from inference.estimate import estimate
from inference.fits.techniques.registry import FITS
from inference.plan import plan
from service.answers.estimates import EstimatesResponse, encode_estimates
from service.bodies import BodyOf
from service.checked_system import aliases_of, checked_frames
from service.errors import OverdueError
from service.exports.negotiation import accepted_type
from service.messages import MESSAGES
from service.messages.answering import message_answer
from service.problems import problem_responses
from service.requests import EstimateRequest
from service.service_settings import ServiceSettings
from service.shared import SMALL, shared_of
from simulator.errors import InvalidInputError

__all__ = ["answer", "quick_answer", "router"]

router = APIRouter(prefix="/v1/estimates", tags=["estimates"])
_FORMS = ("application/json", *(message.media_type for message in MESSAGES))
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


def quick_answer(request: EstimateRequest, settings: ServiceSettings) -> bytes | None:
    """Estimate and encode where that is a matter of milliseconds.

    Parameters
    ----------
    request : EstimateRequest
        As of `answer`.
    settings : ServiceSettings
        How many frames a fit may have.

    Returns
    -------
    bytes or None
        As of `answer`; None where a fit over many frames is asked for, or many frames are sent.

    Raises
    ------
    InvalidInputError
        As of `answer`, and for a fit of too many frames.
    """
    sensor, scene, frames = checked_frames(request.sensor, request.scene, request.frames)
    names = request.techniques
    if names is None:
        names = [name for name in (plan(sensor, scene, frames).chosen,) if name is not None]
    most = settings.max_fit_frames
    if FITS.keys() & set(names):
        if len(frames) > most:
            message = f"a fit over frames takes at most {most} of them here: ask for a posterior"
            raise InvalidInputError.at("/frames", message)
        return None
    if len(frames) * aliases_of(sensor, scene) > SMALL:
        return None
    return encode_estimates(estimate(sensor, scene, frames, request.techniques))


@router.post(
    "",
    response_model=None,
    responses={
        200: {
            "model": EstimatesResponse,
            "content": {message.media_type: {} for message in MESSAGES},
        },
        **problem_responses(400, 413, 415, 422, 503),
    },
)
async def create(request: Request, body: Body) -> Response:
    """Return all physical roots of every frame, or one message a frame by ``Accept``."""
    shared = shared_of(request)
    form = accepted_type(",".join(request.headers.getlist("accept")), _FORMS) or _FORMS[0]
    if form != _FORMS[0]:
        messages = await shared.processes.run(request, message_answer, body[0], form)
        return Response(messages, headers={"Vary": "Accept"}, media_type=form)
    content = await shared.threads.run(request, quick_answer, body[0], shared.settings)
    if content is None:
        try:
            content = await shared.processes.run(request, answer, body[0])
        except OverdueError as error:
            raise OverdueError(f"{error}: ask for a posterior, or send fewer frames") from None
    return Response(content, media_type="application/json")
