"""What this is, and where to go from here: for who opens the address and nothing more."""

import anyio.to_thread
from fastapi import APIRouter, Request
from pydantic import BaseModel

__all__ = ["Directory", "router"]

router = APIRouter(tags=["service"])

_DOCUMENTATION = "docs/http.md of the project, or hybridtof --help"
_HEALTH = "/health/ready"


class Directory(BaseModel):
    """Answer of ``GET /``: paths of this service.

    ``resources`` are what the OpenAPI document describes, in its order, but those of a thing that
    was made and has a name.
    """

    name: str
    version: str
    description: str
    openapi: str
    health: str
    documentation: str
    resources: list[str]


@router.get("/")
async def directory(request: Request) -> Directory:
    """Say what this is, and where its description, its health and its resources are."""
    app = request.app
    described = await anyio.to_thread.run_sync(app.openapi)
    paths = [path for path in described["paths"] if path != "/" and "{" not in path]
    return Directory(
        name=app.title,
        version=app.version,
        description=app.description,
        openapi=app.openapi_url,
        health=_HEALTH,
        documentation=_DOCUMENTATION,
        resources=paths,
    )
