"""From the request that made a stream to what follows it."""

import functools
import json

import numpy as np

from inference.self_calibration.plan import plan_of
from inference.tracking.tracker import tracker
from service.checked_system import checked_system
from service.requests import StreamRequest
from service.streams.followers import Calibrating, Follower, Plain
from service.strict_json import decode
from simulator.errors import InvalidInputError, Problem
from simulator.validated import parse

__all__ = ["model_of", "request_of", "seeded"]


@functools.lru_cache(maxsize=256)
def request_of(raw: bytes) -> StreamRequest:
    """Return the request that made a stream, from its bytes."""
    return parse(StreamRequest, decode(raw))


def seeded(raw: bytes) -> bytes:
    """Return a request with a seed, where it asks for calibrations and has none."""
    asked = request_of(raw)
    if not asked.calibrate or asked.seed is not None:
        return raw
    document = decode(raw)
    # of 53 bits, which readers of JSON that know only floats do not round
    seed = int(np.random.SeedSequence().generate_state(1, np.uint64)[0] >> 11)
    return json.dumps(document | {"seed": seed}).encode()


@functools.lru_cache(maxsize=256)
def model_of(raw: bytes) -> Follower:
    """Return what follows a stream; streams of the same request share it.

    Parameters
    ----------
    raw : bytes
        The request, as JSON.

    Raises
    ------
    InvalidInputError, RefusedError
        As `inference.tracking.tracker.tracker`, and `inference.self_calibration.plan.plan_of`, with
        pointers into the request.
    """
    asked = request_of(raw)
    sensor, scene = checked_system(asked.sensor, asked.scene)
    if asked.seed is not None and not asked.calibrate:
        raise InvalidInputError.at("/seed", "is of calibrations: set calibrate, or leave it out")
    try:
        if asked.calibrate:
            return Calibrating.of(plan_of(sensor, scene, asked.tracking, asked.seed or 0))
        return Plain(tracker(sensor, scene, asked.tracking))
    except InvalidInputError as error:
        raise InvalidInputError(*map(_renamed, error.problems)) from None


def _renamed(problem: Problem) -> Problem:
    if problem.pointer.startswith("/settings"):
        return Problem("/tracking" + problem.pointer.removeprefix("/settings"), problem.message)
    return problem
