"""The forms in which draws are handed out."""

import dataclasses
from collections.abc import Callable
from typing import Any

from inference.posterior.job import Job
from service.draws_described import DescribedDraws, describe_draws

__all__ = ["FORMATS", "DrawsFormat", "accepted_format", "write_draws"]


@dataclasses.dataclass(frozen=True)
class DrawsFormat:
    """One form.

    Attributes
    ----------
    media_type : str
        As in ``Accept`` and ``Content-Type``.
    suffix : str
        Of file names.
    """

    media_type: str
    suffix: str


FORMATS = (
    DrawsFormat("application/x-netcdf", ".nc"),
    DrawsFormat("application/x-ndjson", ".ndjson"),
)
"""The first is sent to whoever accepts anything."""


def _writer(media_type: str) -> Callable[[DescribedDraws], bytes]:
    # imported where it is needed: a service that never exports starts without HDF5
    if media_type == "application/x-netcdf":
        from service.draws_netcdf import to_netcdf

        return to_netcdf
    from service.draws_ndjson import to_ndjson

    return to_ndjson


def write_draws(fold: Any, media_type: str, job: bytes, checkpoint: bytes) -> bytes:
    """Draw again what a checkpoint stands for, and write it: runs in a worker.

    Parameters
    ----------
    fold : (callable, callable, callable)
        ``Job.from_bytes``, ``Checkpoint.from_bytes`` and ``draw`` of the computation.
    media_type : str
        One of `FORMATS`.
    job, checkpoint : bytes
        As stored.

    Returns
    -------
    bytes
    """
    read_job, read_checkpoint, draw = fold
    whole: Job = read_job(job)
    at = read_checkpoint(checkpoint)
    sampled, draws = draw(whole, at)
    return _writer(media_type)(describe_draws(sampled, at.method, draws))


def accepted_format(accept: str) -> DrawsFormat | None:
    """Choose a form by an ``Accept`` header (RFC 9110, 12.5.1).

    Parameters
    ----------
    accept : str
        The header; empty accepts anything.

    Returns
    -------
    DrawsFormat or None
        The one of highest quality, the first of equals; None where none is accepted.
    """
    best, found = 0.0, None
    for form in FORMATS:
        quality = _quality(accept or "*/*", form.media_type)
        if quality > best:
            best, found = quality, form
    return found


def _quality(accept: str, media_type: str) -> float:
    """Return the quality that the most specific range gives a media type."""
    kind = media_type.split("/")[0]
    names = {media_type: 3, media_type.replace("/x-", "/"): 3, f"{kind}/*": 2, "*/*": 1}
    best = (0, 0.0)
    for part in accept.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        quality = 1.0
        for parameter in parameters:
            if parameter.startswith("q="):
                try:
                    quality = min(max(float(parameter[2:]), 0.0), 1.0)
                except ValueError:
                    quality = 0.0
        best = max(best, (names.get(name, 0), quality if name in names else 0.0))
    return best[1]
