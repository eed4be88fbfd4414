"""The application: routes, shared state, start and end."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI

from inference.posterior import fold as posterior_fold
from service import openapi, problems
from service.border import gate
from service.border.authorities import Authorities
from service.border.held import Room
from service.border.keys import KeyRing
from service.border.traces import Traces
from service.cluster import Cluster
from service.fold import Fold
from service.jobs import Jobs
from service.lanes import Processes, Threads
from service.process_pool import ProcessPool
from service.routes import ROUTERS
from service.service_settings import LOCAL, ServiceSettings
from service.shared import Shared
from service.store.database import default_url
from service.store.job_store import JobStore
from service.store.retention import Retention
from service.store.stream_store import StreamStore
from service.streams.calibrations import Calibrations
from service.streams.lines import WINDOW
from service.streams.streams import Streams
from service.warm.warming import Warming

__all__ = ["create_app"]


def create_app(
    settings: ServiceSettings | None = None,
    fold: Fold[Any, Any, Any, Any] = posterior_fold,
    warming: Warming | None = None,
) -> FastAPI:
    """Make an application of its own: nothing is shared between two of them.

    Parameters
    ----------
    settings : ServiceSettings, optional
        Left out: the defaults; the environment is read by the caller.
    fold : Fold, optional
        How posteriors are computed.
    warming : Warming, optional
        Makes machine code from the application's start; left out, it is made when it is needed.

    Returns
    -------
    FastAPI
        An ASGI application; jobs run from its start to its end (ASGI lifespan).

    Raises
    ------
    InvalidInputError
        Where the database, the keys or the cluster of the settings cannot be used.
    """
    settings = settings or ServiceSettings()
    retention = Retention(settings.max_jobs, settings.max_draws_bytes, settings.keep_days * 86_400)
    store = JobStore(settings.database or default_url(), retention)
    local = settings.executor == LOCAL
    workers = ProcessPool(settings.workers) if local else Cluster(settings.executor)
    jobs = Jobs(fold, store, workers, running=settings.workers)
    traces = Traces(store.counts)
    parsing, threads = (Threads(settings.threads, settings.queue) for _ in range(2))
    processes = Processes(settings.threads, settings.queue, settings.request_s)
    kept_s = settings.keep_days * 86_400
    kept = StreamStore(store.database, settings.max_streams, settings.stream_idle_s, kept_s, WINDOW)
    streams = Streams(kept, traces, settings.threads, Calibrations(jobs, settings))
    shared = Shared(settings, jobs, parsing, threads, processes, traces, streams, warming)
    keys = None if settings.api_keys is None else KeyRing(settings.api_keys)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await jobs.start()
        if warming is not None:
            warming.begin()
        try:
            yield
        finally:
            if warming is not None:
                warming.end()
            await streams.close()
            await asyncio.to_thread(processes.close)
            await jobs.close()

    app = FastAPI(
        title="hybridtof",
        version=version("hybridtof"),
        description="Distance from hybrid intensity/time-of-flight sensors. SI units throughout.",
        lifespan=lifespan,
        redirect_slashes=False,
        generate_unique_id_function=openapi.name_of,
        # pages that fetch their scripts from elsewhere; /openapi.json says what they would show
        docs_url=None,
        # what is told of requests the border tells
        telemetry={"tracing": False, "metrics": False, "logs": False},
        redoc_url=None,
    )
    app.state.shared = shared
    problems.install(app)
    openapi.install(app, ROUTERS)
    for router in ROUTERS:
        app.include_router(router)
    gate.install(
        app,
        ROUTERS,
        Authorities.of(settings.allowed_hosts),
        keys,
        traces,
        Room(settings.max_held_bytes),
    )
    return app
