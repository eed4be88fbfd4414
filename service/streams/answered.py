"""What a stream's lines are answered: one JSON object a line."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import orjson

from inference.estimates import Status
from inference.tracking.track import Track
from service.problems import describe
from simulator.errors import HybridTofError

__all__ = ["answers_of", "encoded", "error_of"]

_STATUS = {int(status): status.name.lower() for status in Status}


def answers_of(
    track: Track,
    sequences: Sequence[int],
    times: Sequence[float],
    latencies: Sequence[float],
    also: Sequence[dict[str, Any] | None],
) -> Iterator[bytes]:
    """Yield what a track says of each frame; what is nan is null in JSON.

    Parameters
    ----------
    track : Track
        Of n frames.
    sequences, times, latencies : sequence of int or float
        Of each of them.
    also : sequence of dict or None
        What else is said of each of them.

    Yields
    ------
    bytes
        n of them.
    """
    sd = track.sd_m
    parts = [np.where(np.isfinite(sd), part, np.nan).tolist() for part in track.sd_parts_m]
    rows = zip(
        sequences,
        times,
        track.status.tolist(),
        track.range_m.tolist(),
        sd.tolist(),
        *parts,
        np.isfinite(track.hypotheses_m).sum(axis=1).tolist(),
        track.hypotheses_m.tolist(),
        track.hypotheses_sd_m.tolist(),
        track.hypotheses_weight.tolist(),
        track.present.tolist(),
        track.outlier.tolist(),
        track.rate_m_s.tolist(),
        track.misfit.tolist(),
        latencies,
        also,
        strict=True,
    )
    for (
        sequence, time_s, status, range_m, sd_m, noise, scene, model, count, ranges, deviations,
        weights, present, outlier, rate, misfit, latency, more,
    ) in rows:  # fmt: skip
        answer = {
            "sequence": sequence,
            "time_s": time_s,
            "status": _STATUS[status],
            "range_m": range_m,
            "sd_m": sd_m,
            "sd_parts_m": {"noise": noise, "scene": scene, "model": model},
            "hypotheses": [
                {"range_m": ranges[k], "sd_m": deviations[k], "weight": weights[k]}
                for k in range(count)
            ],
            "present": present,
            "outlier": outlier,
            "rate_m_s": rate,
            "misfit": misfit,
            "latency_s": latency,
        }
        if more is not None:
            answer.update(more)
        yield encoded(answer)


def error_of(error: HybridTofError) -> dict[str, Any]:
    """Return what is said of a line that cannot be answered."""
    details = describe(error)
    pointers: Sequence[Mapping[str, str]] = details["errors"]
    return {
        "type": details["type"],
        "title": details["title"],
        "pointer": pointers[0]["pointer"] if pointers else "",
        "detail": details["detail"],
    }


def encoded(answer: dict[str, Any]) -> bytes:
    """Return an answer as JSON without a line end; what is not finite is null."""
    try:
        return orjson.dumps(answer)
    except TypeError:  # a number beyond 64 bits, which was passed through
        return json.dumps(_finite(answer), allow_nan=False).encode("ascii")


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(member) for name, member in value.items()}
    return [_finite(entry) for entry in value] if isinstance(value, list) else value
