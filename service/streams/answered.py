"""What a stream's lines are answered: one JSON object a line."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.track import Track
from service.problems import describe
from simulator.errors import HybridTofError

__all__ = ["answers_of", "encoded", "error_of"]

Array = NDArray[np.float64]

_STATUS = {int(status): status.name.lower() for status in Status}


def answers_of(
    track: Track,
    sequences: Sequence[int],
    times: Sequence[float],
    latencies: Array,
    also: Sequence[dict[str, Any] | None] | None = None,
) -> list[bytes]:
    """Return what a track says of each frame; what is nan is null in JSON.

    The texts of all numbers are made in one go and laid between those that answers have in common:
    an object a frame costs several times as much.

    Parameters
    ----------
    track : Track
        Of n frames.
    sequences, times : sequence of int or float
        Of each of them.
    latencies : ndarray, shape (n,)
        Of each of them [s].
    also : sequence of dict or None, optional
        What else is said of each of them.

    Returns
    -------
    list of bytes
        n of them, without line ends.
    """
    sd = track.sd_m
    parts = [np.where(np.isfinite(sd), part, np.nan) for part in track.sd_parts_m]
    flags = np.where(track.misfit, "true", "false").tolist()
    kinds = list(map(_STATUS.__getitem__, track.status.tolist()))
    rest = [""] * len(track) if also is None else list(map(_more, also))
    heads = [_texts(sequences), _texts(times), kinds]
    ranges = [track.range_m, sd, *parts]
    numbers = [track.present, track.outlier, track.rate_m_s]
    counts = np.isfinite(track.hypotheses_m).sum(axis=1)
    answers = np.empty(len(track), dtype=object)
    for count in np.unique(counts).tolist():
        which = np.flatnonzero(counts == count)
        every = which.size == len(track)
        hypotheses = [
            column[:, k]
            for k in range(count)
            for column in (track.hypotheses_m, track.hypotheses_sd_m, track.hypotheses_weight)
        ]
        table = np.column_stack([*ranges, *hypotheses, *numbers, latencies])
        *said, latency = _columns(table if every else table[which])
        texts = [*heads, flags, rest]
        if not every:
            at = which.tolist()
            texts = [[column[i] for i in at] for column in texts]
        sequence, time_s, status, misfit, more = texts
        laid = _laid(count, [sequence, time_s, status, *said, misfit, latency, more])
        if every:
            return laid
        answers[which] = laid
    return answers.tolist()


_HEAD = '{"sequence":', ',"time_s":', ',"status":"', '","range_m":', ',"sd_m":'
_PARTS = ',"sd_parts_m":{"noise":', ',"scene":', ',"model":'
_HYPOTHESIS = '{"range_m":', ',"sd_m":', ',"weight":'
_TAIL = ',"outlier":', ',"rate_m_s":', ',"misfit":', ',"latency_s":', ""


def _laid(count: int, columns: list[list[str]]) -> list[bytes]:
    """Lay the texts of answers with ``count`` hypotheses between those that they share."""
    fixed = [*_HEAD, *_PARTS]
    opening = '},"hypotheses":['
    for k in range(count):
        first, *others = _HYPOTHESIS
        fixed += [("}," if k else opening) + first, *others]
    fixed.append(("}]" if count else opening + "]") + ',"present":')
    fixed += _TAIL
    n, width = len(columns[0]), 2 * len(fixed) + 1
    pieces = [""] * (n * width)
    for k, (text, column) in enumerate(zip(fixed, columns, strict=True)):
        pieces[2 * k :: width] = [text] * n
        pieces[2 * k + 1 :: width] = column
    pieces[width - 1 :: width] = ["}\n"] * n
    return "".join(pieces).encode().split(b"\n")[:-1]  # no JSON text has a line end of its own


def _texts(values: Sequence[float]) -> list[str]:
    """Return the JSON texts of numbers."""
    return orjson.dumps(values)[1:-1].decode("ascii").split(",")


def _columns(table: Array) -> list[list[str]]:
    """Return the JSON texts of the columns of a table."""
    text = orjson.dumps(np.ascontiguousarray(table.T).ravel(), option=orjson.OPT_SERIALIZE_NUMPY)
    every, n = text[1:-1].decode("ascii").split(","), table.shape[0]
    return [every[k * n : (k + 1) * n] for k in range(table.shape[1])]


def _more(also: dict[str, Any] | None) -> str:
    """Return the JSON text of further members."""
    return "" if not also else "," + encoded(also)[1:-1].decode()


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
