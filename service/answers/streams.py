"""Streams as clients see them."""

from typing import Any, Literal

import orjson
import pydantic

from service.store.stream_record import StreamRecord

__all__ = ["StreamLine", "StreamPage", "StreamResponse", "stream_of"]


class StreamResponse(pydantic.BaseModel):
    """Answer of ``GET /v1/streams/{id}``: how a stream stands."""

    id: str
    status: Literal["tracking", "expired"]
    sequence: int | None
    answered: int
    errors: int
    dropped: int
    gaps: int
    surprise: float | None
    misfit: bool
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
    return head | counts | {"last": orjson.loads(record.last or b"null")}
