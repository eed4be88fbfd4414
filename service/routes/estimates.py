"""Deterministic estimates, at once."""

from collections.abc import Callable, Generator
from typing import Annotated, Any, TypeVar, cast, get_args

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import Response

from inference.estimate import estimate_planned
from inference.fits.techniques.registry import FITS
from inference.plan import plan
from service.answers.answering import answer_parts
from service.answers.encoding import AnswerShape, encode_estimates
from service.answers.estimates import ColumnarEstimatesResponse, EstimatesResponse
from service.answers.in_parts import joined
from service.bodies import BodyOf
from service.checked_system import aliases_of, checked_frames
from service.errors import NotAcceptableError, OverdueError
from service.exports.negotiation import accepted_type
from service.messages import MESSAGES
from service.messages.answering import message_parts
from service.problems import problem_responses
from service.requests import EstimateRequest
from service.routes.direct import DirectRoute
from service.service_settings import ServiceSettings
from service.shared import SMALL, TINY, TINY_BYTES, Shared, shared_of
from simulator.compiled import NotReadyError, ready_only
from simulator.errors import InvalidInputError, listed

__all__ = ["quick_answer", "router"]

R = TypeVar("R")

_READ = BodyOf(EstimateRequest)


class _Estimates(DirectRoute):
    async def answer(self, request: Request) -> Response:
        """See `DirectRoute`."""
        shape: AnswerShape = "rows"
        if request.scope["query_string"]:
            asked = request.query_params.get("shape", shape)
            if asked not in get_args(AnswerShape):
                message = f"must be {' or '.join(get_args(AnswerShape))}"
                raise InvalidInputError.at("/query/shape", message)
            shape = cast("AnswerShape", asked)
        return await create(request, await _READ(request), shape)


router = APIRouter(prefix="/v1/estimates", tags=["estimates"], route_class=_Estimates)
_FORMS = ("application/json", *(message.media_type for message in MESSAGES))
_ANY = frozenset({"", "*/*", _FORMS[0]})
Body = Annotated[tuple[EstimateRequest, bytes], Depends(_READ)]


def quick_answer(
    request: EstimateRequest,
    settings: ServiceSettings,
    shape: AnswerShape = "rows",
    most: int = SMALL,
) -> bytes | None:
    """Estimate and encode where that is a matter of milliseconds.

    Parameters
    ----------
    request : EstimateRequest
        As of `answer_parts`.
    settings : ServiceSettings
        How many frames a fit may have.
    shape : str
        As of `answer_parts`.
    most : int
        Estimates of frames that may be asked for, by all techniques together.

    Returns
    -------
    bytes or None
        JSON as in docs/http.md, estimates; None where a fit over many frames is asked for, or more
        than ``most``.

    Raises
    ------
    InvalidInputError
        As of `answer_parts`, and for a fit of too many frames.
    """
    sensor, scene, frames = checked_frames(request.sensor, request.scene, request.frames)
    choice = plan(sensor, scene, frames)
    names = {choice.chosen} if request.techniques is None else set(request.techniques)
    limit = settings.max_fit_frames
    if FITS.keys() & names:
        if len(frames) > limit:
            message = f"a fit over frames takes at most {limit} of them here: ask for a posterior"
            raise InvalidInputError.at("/frames", message)
        return None
    if len(frames) * aliases_of(sensor, scene) * len(names) > most:
        return None
    found = estimate_planned(sensor, scene, frames, choice, request.techniques)
    return encode_estimates(found, shape)


def tiny_answer(
    request: EstimateRequest, settings: ServiceSettings, shape: AnswerShape
) -> bytes | None:
    """Answer as `quick_answer`; None where that takes longer than handing it to a thread may."""
    try:
        with ready_only():
            return quick_answer(request, settings, shape, TINY)
    except NotReadyError:
        return None


async def _in_time(
    request: Request, shared: Shared, function: Callable[..., Generator[R, None, R]], *asked: Any
) -> list[R]:
    """Return the parts of an answer, or those that were there in time; none is an error."""
    reason = (
        f"the request takes more than {shared.settings.request_s:g} s of processor time: "
        "ask for a posterior, state numbers as known, or send fewer frames"
    )
    try:
        return await shared.processes.run_in_parts(request, function, *asked, reason)
    except OverdueError as error:
        if not error.parts:
            raise OverdueError(reason) from None
        return list(error.parts)


@router.post(
    "",
    response_model=None,
    responses={
        200: {
            "model": EstimatesResponse | ColumnarEstimatesResponse,
            "content": {message.media_type: {} for message in MESSAGES},
        },
        **problem_responses(400, 406, 413, 415, 422, 503),
    },
)
async def create(
    request: Request,
    body: Body,
    shape: Annotated[AnswerShape, Query(description="of `frames` in JSON")] = "rows",
) -> Response:
    """Return all physical roots of every frame, or one message a frame by ``Accept``.

    ``frames`` are a list of objects, or with ``shape=columns`` an object of lists.
    """
    shared, asked = shared_of(request), body[0]
    accept = ",".join(request.headers.getlist("accept"))
    if accept not in _ANY:
        form = accepted_type(accept, _FORMS)
        if form is None:
            raise NotAcceptableError(f"estimates come as {listed(_FORMS)}")
        if form != _FORMS[0]:
            messages = (await _in_time(request, shared, message_parts, asked, form))[-1]
            return Response(messages, headers={"Vary": "Accept"}, media_type=form)
    tiny = len(body[1]) <= TINY_BYTES
    content = tiny_answer(asked, shared.settings, shape) if tiny else None
    if content is None:
        content = await shared.threads.run(request, quick_answer, asked, shared.settings, shape)
    if content is None:
        content = joined(await _in_time(request, shared, answer_parts, asked, shape))
    return Response(content, media_type="application/json")
