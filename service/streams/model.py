"""From the request that made a stream to the tracker that follows it."""

import functools

from inference.tracking.tracker import Tracker, tracker
from service.checked_system import checked_system
from service.requests import StreamRequest
from service.strict_json import decode
from simulator.errors import InvalidInputError, Problem
from simulator.validated import parse

__all__ = ["model_of", "request_of"]


def request_of(raw: bytes) -> StreamRequest:
    """Return the request that made a stream, from its bytes."""
    return parse(StreamRequest, decode(raw))


@functools.lru_cache(maxsize=256)
def model_of(raw: bytes) -> Tracker:
    """Return a stream's tracker; streams of the same request share it.

    Parameters
    ----------
    raw : bytes
        The request, as JSON.

    Returns
    -------
    Tracker

    Raises
    ------
    InvalidInputError, RefusedError
        As `inference.tracking.tracker.tracker`, with pointers into the request.
    """
    asked = request_of(raw)
    sensor, scene = checked_system(asked.sensor, asked.scene)
    try:
        return tracker(sensor, scene, asked.tracking)
    except InvalidInputError as error:
        raise InvalidInputError(*map(_renamed, error.problems)) from None


def _renamed(problem: Problem) -> Problem:
    if problem.pointer.startswith("/settings"):
        return Problem("/tracking" + problem.pointer.removeprefix("/settings"), problem.message)
    return problem
