"""Answers of a stream as messages: the same lines, with a message for what they say of the range.

A message has the range where it is the only one and nothing contradicts it. Its variance is that of
all hypotheses together, as they are weighted.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import orjson

from inference.tracking.tracker import Tracker
from service.errors import NotAcceptableError
from service.exports.negotiation import accepted_type
from service.messages import MESSAGES
from service.messages.measured import Limits, Measured
from service.messages.message import Message
from service.streams.answered import encoded
from simulator.errors import listed

__all__ = [
    "LINES",
    "as_messages",
    "limits_of_tracker",
    "line_as_message",
    "lines_type",
    "message_for",
]

LINES = "application/x-ndjson"
_HARDLY = 0.05  # probability of an object below which the scene is called empty
_DOUBTED = 0.5  # probability that a frame has nothing to do with the scene

_SAID = frozenset(
    {"time_s", "range_m", "sd_m", "sd_parts_m", "hypotheses", "present", "outlier", "rate_m_s"}
)
"""Members that the message stands for; all others of a line stay beside it."""


def limits_of_tracker(model: Tracker) -> Limits:
    """Return between which ranges a tracker answers [m]."""
    table = model.model.table
    return math.exp(table.start), math.exp(table.end)


def message_for(accept: str) -> Message | None:
    """Return the message that a client accepts; None where it takes the lines as they are.

    Raises
    ------
    NotAcceptableError
        Where it takes neither.
    """
    # lines with messages are asked for by the message, or as they are answered
    by_message = {message.media_type: message for message in MESSAGES}
    by_lines = {lines_type(message): message for message in MESSAGES}
    forms = {LINES: None, **by_message, "application/json": None, **by_lines}
    form = accepted_type(accept, forms)
    if form is None:
        raise NotAcceptableError(f"answers to frames come as {listed(tuple(forms))}")
    return forms[form]


def lines_type(message: Message | None) -> str:
    """Return the media type of lines, which hold messages or do not."""
    return LINES if message is None else f'{LINES}; profile="{message.media_type}"'


def as_messages(message: Message, limits_m: Limits, lines: Iterable[bytes]) -> list[bytes]:
    """Return lines with messages, as `line_as_message` makes them."""
    return [line_as_message(message, limits_m, line) for line in lines]


def line_as_message(message: Message, limits_m: Limits, line: bytes) -> bytes:
    """Return a line of a stream's answer with a message in place of its numbers.

    Parameters
    ----------
    limits_m : (float, float)
        As of `limits_of_tracker`.
    line : bytes
        As `service.streams` answers it. One that tells an error stays as it is.
    """
    answer: dict[str, Any] = orjson.loads(line)
    if "error" in answer:
        return line
    beside = {name: value for name, value in answer.items() if name not in _SAID}
    return encoded(beside | {"message": message.write(_measured(answer, limits_m))})


def _measured(answer: Mapping[str, Any], limits_m: Limits) -> Measured:
    unique = answer["status"] == "unique"
    variance = _variance(answer)
    return Measured(
        status=answer["status"],
        range_m=answer["range_m"] if unique else None,
        variance_m2=variance,
        side="far" if _is_empty(answer) else None,
        certain=unique and variance is not None and not answer["misfit"],
        time_s=answer["time_s"],
        limits_m=limits_m,
    )


def _is_empty(answer: Mapping[str, Any]) -> bool:
    """Tell whether an empty scene explains a frame, and an object hardly could.

    Robots drive through what is "too far or nothing". Readings that neither an object as stated nor
    an empty scene explains are of something else, and that may stand right before the sensor.
    """
    if answer["status"] != "none" or answer["misfit"]:
        return False
    return bool(answer["present"] < _HARDLY and answer["outlier"] < _DOUBTED)


def _variance(answer: Mapping[str, Any]) -> float | None:
    """Return the variance of all hypotheses together, about the range where there is one [m^2]."""
    hypotheses, range_m, sd = answer["hypotheses"], answer["range_m"], answer["sd_m"]
    weight = sum(one["weight"] for one in hypotheses)
    if answer["status"] in ("none", "saturated") or not weight > 0:
        return None
    if answer["status"] == "unique" and (range_m is None or sd is None):
        return None
    centre = range_m
    if centre is None:
        centre = sum(one["weight"] * one["range_m"] for one in hypotheses) / weight
    square = sum(
        one["weight"] * (one["sd_m"] ** 2 + (one["range_m"] - centre) ** 2) for one in hypotheses
    )
    return float(max(square / weight, (sd or 0.0) ** 2))
