"""One file a resource, each with its router; a new one is a file beside these and a line here."""

from fastapi import APIRouter

from service.routes import (
    estimates,
    health,
    identifiability,
    metrics,
    posteriors,
    root,
    simulations,
    streams,
    techniques,
    umbridge,
)

__all__ = ["ROUTERS"]

ROUTERS: tuple[APIRouter, ...] = (
    root.router,
    estimates.router,
    identifiability.router,
    posteriors.router,
    streams.router,
    simulations.router,
    techniques.router,
    health.router,
    metrics.router,
    umbridge.router,
)
