"""Posteriors: asked for, watched, cancelled, forgotten."""

import hashlib
import re
from collections.abc import AsyncIterable, AsyncIterator
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request
from fastapi.responses import Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.exceptions import HTTPException

from service.answers.posteriors import PosteriorPage, PosteriorResponse, brief, full
from service.bodies import BodyOf
from service.caps import capped
from service.checked_system import checked_frames
from service.errors import MalformedError, NotAcceptableError
from service.exports import EXPORTS
from service.exports.negotiation import accepted_export
from service.lanes import while_wanted
from service.problems import problem_responses
from service.requests import PosteriorRequest
from service.routes.resources import Cursor, LastEventId, answered, event_of, place_of
from service.shared import client_of, shared_of
from service.store.record import FINISHED, JobRecord
from service.system_description import SystemDescription

__all__ = ["router"]

router = APIRouter(prefix="/v1/posteriors", tags=["posteriors"])
Body = Annotated[tuple[PosteriorRequest, bytes], Depends(BodyOf(PosteriorRequest))]

# by which OpenAPI says what is refused here, with words of its own
_KEY = "^[!-~]{1,255}$"


def _key(header: str | None) -> str | None:
    if header is not None and not re.fullmatch(_KEY, header):
        raise MalformedError("Idempotency-Key must be 1 to 255 visible ASCII characters")
    return header


@router.post(
    "",
    status_code=202,
    response_model=None,
    responses={202: {"model": PosteriorResponse}, **problem_responses(400, 413, 415, 422, 503)},
)
async def create(
    request: Request,
    body: Body,
    idempotency_key: Annotated[str | None, Header(json_schema_extra={"pattern": _KEY})] = None,
) -> Response:
    """Start a posterior; the same Idempotency-Key with the same body gives the same one."""
    key = _key(idempotency_key)
    asked, raw = body
    shared = shared_of(request)
    sampler = capped(shared.settings, asked.sampler)
    checked = await shared.threads.run(
        request, checked_frames, asked.sensor, asked.scene, asked.frames
    )
    digest = hashlib.sha256(raw).hexdigest()
    record = await shared.jobs.submit(
        *checked, sampler, key=key, digest=digest, client=client_of(request)
    )
    return answered(full(record), 202, {"Location": f"/v1/posteriors/{record.id}"})


@router.get(
    "",
    response_model=None,
    responses={200: {"model": PosteriorPage}, **problem_responses(400, 422)},
)
async def page(
    request: Request,
    cursor: Cursor = None,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
) -> Response:
    """List posteriors, the newest first; ``next_cursor`` is null on the last page."""
    after, client = place_of(cursor), client_of(request)
    records = await shared_of(request).jobs.page(after, limit + 1, client)
    more = str(records[limit - 1].sequence) if len(records) > limit else None
    return answered({"items": [brief(r) for r in records[:limit]], "next_cursor": more})


@router.get(
    "/{job_id}",
    response_model=None,
    responses={200: {"model": PosteriorResponse}, **problem_responses(404)},
)
async def get(request: Request, job_id: str) -> Response:
    """Return a posterior as it stands."""
    return answered(full(await shared_of(request).jobs.get(job_id, client_of(request))))


async def _followed(
    request: Request,
    job_id: str,
    last_event_id: LastEventId = None,
) -> AsyncIterator[JobRecord]:
    """Refuse before the stream begins, where there is nothing to follow."""
    after = event_of(last_event_id)
    jobs = shared_of(request).jobs
    record = await jobs.get(job_id, client_of(request))
    if record.status in FINISHED and record.revision <= after:
        raise HTTPException(204)  # so that a browser asks no more
    return jobs.follow(job_id, after, client_of(request))


@router.get(
    "/{job_id}/events",
    response_class=EventSourceResponse,
    responses={
        204: {"description": "It has ended, and that event was seen"},
        **problem_responses(404),
    },
)
async def events(
    changes: Annotated[AsyncIterator[JobRecord], Depends(_followed)],
) -> AsyncIterable[ServerSentEvent]:
    """Tell how a posterior stands at every change, until it has ended.

    ``Last-Event-ID`` goes on behind an event; changes in quick succession may be told as one.
    """
    async for record in changes:
        yield ServerSentEvent(data=brief(record), id=str(record.revision))


@router.get(
    "/{job_id}/draws",
    response_model=None,
    response_class=Response,
    responses={
        200: {"content": {form.media_type: {} for form in EXPORTS}},
        **problem_responses(404, 406, 409, 410, 503),
    },
)
async def draws(request: Request, job_id: str) -> Response:
    """Return the draws of a finished posterior in a form that ``Accept`` names."""
    form = accepted_export(",".join(request.headers.getlist("accept")))
    if form is None:
        names = " or ".join(form.media_type for form in EXPORTS)
        raise NotAcceptableError(f"draws come as {names}")
    making = shared_of(request).jobs.ended.draws(job_id, form.media_type, client_of(request))
    data = await while_wanted(request, making)
    name = f'attachment; filename="{job_id}{form.suffix}"'
    headers = {"Content-Disposition": name, "Vary": "Accept"}
    return Response(data, headers=headers, media_type=form.media_type)


@router.get(
    "/{job_id}/scene",
    response_model=None,
    responses={200: {"model": SystemDescription}, **problem_responses(404, 409, 410, 422, 503)},
)
async def scene(request: Request, job_id: str, other_objects: bool = False) -> Response:
    """Return sensor and scene as a finished posterior knows them, for whatever takes a scene.

    With `other_objects` nothing is kept of the object that was there, nor of its shadow.
    """
    date = datetime.now(UTC).isoformat(timespec="seconds")
    ended = shared_of(request).jobs.ended
    making = ended.scene(job_id, date, client_of(request), other_objects)
    return Response(await while_wanted(request, making), media_type="application/json")


@router.post(
    "/{job_id}/cancel",
    status_code=202,
    response_model=None,
    responses={202: {"model": PosteriorResponse}, **problem_responses(404)},
)
async def cancel(request: Request, job_id: str) -> Response:
    """End a posterior after the chunk that runs; it keeps what it has. One that ended stays."""
    return answered(full(await shared_of(request).jobs.cancel(job_id, client_of(request))), 202)


@router.delete("/{job_id}", status_code=204, response_model=None, responses=problem_responses(404))
async def delete(request: Request, job_id: str) -> Response:
    """Forget a posterior, running or not."""
    await shared_of(request).jobs.delete(job_id, client_of(request))
    return Response(status_code=204)
