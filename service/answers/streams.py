"""Streams as clients see them."""

from typing import Any, Literal

import orjson
import pydantic

from service.store.stream_record import StreamRecord
from service.streams.calibrations import posterior_id

__all__ = ["StreamLine", "StreamPage", "StreamResponse", "stream_of"]


class Quantiles(pydantic.BaseModel):
    """What is known of one unknown."""

    q05: float
    q50: float
    q95: float


class SceneKnown(pydantic.BaseModel):
    """What is known of a scene, and what it says of one frame."""

    scene: dict[str, Quantiles]
    status: Literal["unique", "ambiguous", "none", "saturated"]
    range_m: float | None
    sd_m: float | None


class CalibrationEvent(pydantic.BaseModel):
    """What changed at a line of a stream that calibrates itself (docs/streams.md)."""

    kind: Literal["taken", "not_taken", "doubted"]
    reason: str
    sequence: int
    applies_at: int
    number: int | None = None
    seed: int | None = None
    decided_at: int | None = None
    from_sequence: int | None = None
    to_sequence: int | None = None
    frames: int | None = None
    frames_without_object: int | None = None
    misfit: bool | None = None
    before: SceneKnown
    after: SceneKnown
    posterior: str | None = None


class AskedCalibration(pydantic.BaseModel):
    """A calibration that is under way."""

    number: int
    seed: int
    reason: str
    decided_at: int
    posterior: str


class StreamCalibration(pydantic.BaseModel):
    """How a stream calibrates itself: with which seed, from how many frames, and what changed."""

    seed: int
    known: bool
    gathered: int
    asked: AskedCalibration | None
    events: list[CalibrationEvent]


class StreamResponse(pydantic.BaseModel):
    """Answer of ``GET /v1/streams/{id}``: how a stream stands."""

    id: str
    status: Literal["calibrating", "tracking", "expired"]
    sequence: int | None
    answered: int
    errors: int
    dropped: int
    gaps: int
    surprise: float | None
    misfit: bool
    calibration: StreamCalibration | None
    last: dict[str, Any] | None


class StreamPage(pydantic.BaseModel):
    """Answer of ``GET /v1/streams``: the newest first."""

    items: list[StreamResponse]
    next_cursor: str | None


class _Parts(pydantic.BaseModel):
    noise: float | None
    scene: float | None
    model: float | None


class _Hypothesis(pydantic.BaseModel):
    range_m: float
    sd_m: float
    weight: float


class _Error(pydantic.BaseModel):
    type: str
    title: str
    pointer: str
    detail: str


class StreamLine(pydantic.BaseModel):
    """One line of the answer to frames: a frame's range, or why it has none; with what was sent."""

    model_config = pydantic.ConfigDict(extra="allow")

    sequence: int | None
    gap: int = 0
    dropped: int = 0
    time_s: float | None = None
    status: Literal["unique", "ambiguous", "none", "saturated"] | None = None
    range_m: float | None = None
    sd_m: float | None = None
    sd_parts_m: _Parts | None = None
    hypotheses: list[_Hypothesis] | None = None
    present: float | None = None
    outlier: float | None = None
    rate_m_s: float | None = None
    misfit: bool | None = None
    latency_s: float | None = None
    reason: str | None = None
    calibration: CalibrationEvent | None = None
    assumptions: list[str] | None = None
    error: _Error | None = None


_NONE_YET: dict[str, Any] = {
    "answered": 0,
    "errors": 0,
    "dropped": 0,
    "gaps": 0,
    "surprise": None,
    "misfit": False,
}


def stream_of(record: StreamRecord, status: str) -> dict[str, Any]:
    """Return the body of ``GET /v1/streams/{id}``."""
    sequence = None if record.sequence < 0 else record.sequence
    head = {"id": record.id, "status": status, "sequence": sequence}
    counts = {name: record.counts.get(name, none) for name, none in _NONE_YET.items()}
    last = orjson.loads(record.last or b"null")
    return head | counts | {"calibration": _calibration(record), "last": last}


def _calibration(record: StreamRecord) -> dict[str, Any] | None:
    """Return what is told of calibrations, with the posteriors behind them."""
    told: dict[str, Any] | None = record.counts.get("calibration")
    if told is None:
        return None

    def linked(entry: dict[str, Any]) -> dict[str, Any]:
        number = entry.get("number")
        return entry if number is None else entry | {"posterior": posterior_id(record.id, number)}

    asked = None if told["asked"] is None else linked(told["asked"])
    return told | {"asked": asked, "events": [linked(event) for event in told["events"]]}
