"""ServiceSettings of the service, from environment variables ``HYBRIDTOF_<NAME>``."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import pydantic

from simulator.errors import InvalidInputError, Problem

__all__ = ["LOCAL", "PREFIX", "ServiceSettings"]

PREFIX = "HYBRIDTOF_"
LOCAL = "local"
Count = Annotated[int, pydantic.Field(ge=1)]
Host = Annotated[
    str, pydantic.Field(max_length=255, pattern=r"^(\*|[A-Za-z0-9._-]+|\[?[0-9A-Fa-f:.]+\]?)$")
]


def _split(value: object) -> object:
    """Return the parts of a list that is separated by commas."""
    if isinstance(value, str):
        return tuple(part.strip() for part in value.split(",") if part.strip())
    return value


class ServiceSettings(pydantic.BaseModel):
    """What an operator may choose.

    Attributes
    ----------
    executor : str
        Where posteriors are computed: ``local``, or the address of a Dask scheduler
        (`service.cluster`).
    workers : int
        Processes for posteriors, each of one thread; with a cluster, posteriors at a time.
    threads : int
        Threads for estimates and simulations.
    queue : int
        Requests that may wait for a thread, and as many for a process; more get 503.
    request_s : float
        Processor time of one request [s]: of a fit over many frames, of a large batch.
    max_fit_frames : int
        Most frames of a fit that is answered at once.
    max_trajectory : int
        Most frames of a simulation.
    max_seconds, max_target_ess, max_ensembles
        Most that a posterior may ask for.
    max_body_bytes : int
        Largest request body: of two columns, room for 200,000 frames.
    max_held_bytes : int
        Bytes of bodies and answers that are held at a time, over all requests.
    connections : int
        Connections at a time; more are closed.
    client_s : float
        Time that a client has for the head of a request, for its body (and a second for every
        megabyte), and to read a block of an answer [s].
    api_keys : Path or None
        File of the keys of those who may use the service (``hybridtof keys``); None: everybody who
        can reach it.
    allowed_hosts : tuple of str
        Names by which the service may be called besides those of loopback, separated by commas in
        the environment; ``*`` is any.
    database : str or None
        Address of the store of jobs, of an SQLite file or PostgreSQL; None: a file in the user's
        state folder.
    max_jobs : int
        Posteriors that are kept; finished ones make room for new ones, the oldest first.
    max_draws_bytes : int
        Bytes for the draws of finished posteriors; the oldest make room.
    keep_days : float
        How long finished posteriors are kept [days].
    max_streams : int
        Streams that are kept; expired ones make room, and one key has half of them at most.
    stream_idle_s : float
        Time without a line after which a stream has expired [s].
    warm : bool
        Whether `serve` makes all machine code from its start on.
    shutdown_s : float
        How long open requests may take to end after SIGTERM [s].
    """

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    executor: str = LOCAL
    workers: Count = pydantic.Field(default_factory=lambda: os.cpu_count() or 1)
    threads: Count = 2
    queue: Count = 256
    request_s: Annotated[float, pydantic.Field(gt=0)] = 10.0
    max_fit_frames: Count = 10_000
    max_trajectory: Count = 100_000
    max_seconds: Annotated[float, pydantic.Field(gt=0)] = 86_400.0
    max_target_ess: Annotated[int, pydantic.Field(ge=10)] = 1_000_000
    max_ensembles: Annotated[int, pydantic.Field(ge=2)] = 32
    max_body_bytes: Count = 8 * 2**20
    max_held_bytes: Count = 32 * 2**20
    connections: Count = 500
    client_s: Annotated[float, pydantic.Field(gt=0)] = 10.0
    api_keys: Path | None = None
    allowed_hosts: Annotated[tuple[Host, ...], pydantic.BeforeValidator(_split)] = ()
    database: str | None = None
    max_jobs: Count = 1000
    max_draws_bytes: Count = 2**30
    keep_days: Annotated[float, pydantic.Field(gt=0)] = 30.0
    max_streams: Count = 1000
    stream_idle_s: Annotated[float, pydantic.Field(gt=0)] = 3600.0
    warm: bool = True
    shutdown_s: Annotated[float, pydantic.Field(ge=0, le=10)] = 5.0

    @classmethod
    def from_environment(cls, environment: Mapping[str, str]) -> "ServiceSettings":
        """Read the settings from environment variables.

        Parameters
        ----------
        environment : mapping
            Such as ``os.environ``; variables without the prefix are not looked at.

        Returns
        -------
        ServiceSettings
            Defaults where nothing is said.

        Raises
        ------
        InvalidInputError
            For an unknown variable with the prefix and for a value that does not fit, each
            named.
        """
        given = {
            name.removeprefix(PREFIX).lower(): value
            for name, value in environment.items()
            if name.startswith(PREFIX)
        }
        try:
            return cls.model_validate(given)
        except pydantic.ValidationError as error:
            problems = [
                Problem(f"/{PREFIX}{str(item['loc'][0]).upper()}", item["msg"])
                for item in error.errors(include_url=False, include_input=False)
            ]
            raise InvalidInputError(*problems) from None
