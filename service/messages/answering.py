"""Estimates as messages: the answer to a request that accepts one of their forms."""

import json
from collections.abc import Generator, Sequence

from inference.estimates import Estimates
from inference.in_turn import estimates_in_turn
from inference.known import known_of
from inference.plan import plan
from inference.techniques import ALL_TECHNIQUES
from service.checked_system import checked_frames
from service.messages import MESSAGES
from service.messages.measured import limits_of, measured_of
from service.messages.message import Message
from service.requests import EstimateRequest
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["encode_messages", "message_parts"]


def encode_messages(
    message: Message,
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    estimates: Estimates,
    techniques: Sequence[str] | None = None,
) -> bytes:
    """Return the answers of the chosen technique, one message a frame.

    Parameters
    ----------
    sensor, scene, frames
        As they were asked of.
    estimates : Estimates
        What came of them.
    techniques : sequence of str, optional
        Those that were asked for, whose reasons a refusal gives; left out: all.

    Returns
    -------
    bytes
        JSON: ``technique`` and ``messages``.

    Raises
    ------
    RefusedError
        Where no technique has a result, with the reasons.
    """
    if estimates.chosen is None:
        reasons = "; ".join(
            f"{item.name}: {item.reason}"
            for item in estimates.left_out
            if not techniques or item.name in techniques
        )
        raise RefusedError(f"no technique serves this scene: {reasons}")
    (result,) = (r for r in estimates.results if r.technique == estimates.chosen)
    limits = limits_of(ALL_TECHNIQUES[estimates.chosen], sensor, known_of(scene))
    time_s = None if frames.time_s is None else frames.time_s.tolist()
    written = [message.write(measured) for measured in measured_of(result, time_s, limits)]
    body = {"technique": estimates.chosen, "messages": written}
    return json.dumps(body, allow_nan=False).encode("ascii")


def message_parts(
    request: EstimateRequest, media_type: str, overdue: str
) -> Generator[bytes, None, bytes]:
    """Estimate, and encode as messages whenever another technique is the chosen one.

    Parameters
    ----------
    request : EstimateRequest
        Sensor, scene, frames and techniques.
    media_type : str
        Of one of `MESSAGES`.
    overdue : str
        Why a technique is left out that has not answered when there is no more time.

    Yields
    ------
    bytes
        As of `encode_messages`: all that is to be said if no other technique answers in time.

    Returns
    -------
    bytes
        The last of it.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    RefusedError
        As of `encode_messages`.
    """
    sensor, scene, frames = checked_frames(request.sensor, request.scene, request.frames)
    form = {message.media_type: message for message in MESSAGES}[media_type]
    choice = plan(sensor, scene, frames)
    turns = estimates_in_turn(sensor, scene, frames, choice, request.techniques, overdue)
    chosen, messages = None, b""
    while True:
        try:
            so_far = next(turns)
        except StopIteration as end:
            found: Estimates = end.value
            if messages and found.chosen == chosen:
                return messages
            return encode_messages(form, sensor, scene, frames, found, request.techniques)
        if so_far.chosen != chosen:
            chosen = so_far.chosen
            messages = encode_messages(form, sensor, scene, frames, so_far, request.techniques)
            yield messages
