"""Counts for Prometheus."""

import anyio.to_thread
from fastapi import APIRouter, Request
from fastapi.responses import Response
from prometheus_client import CONTENT_TYPE_LATEST

from service.shared import shared_of

__all__ = ["router"]

router = APIRouter(prefix="/metrics", tags=["health"])


@router.get("", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
async def metrics(request: Request) -> Response:
    """Return counts of requests and posteriors in the form that Prometheus reads."""
    text = await anyio.to_thread.run_sync(shared_of(request).traces.text)
    return Response(text, media_type=CONTENT_TYPE_LATEST)
