"""What a stream's lines are answered: one JSON object a line."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from inference.estimates import Status
from service.problems import describe
from service.streams.said import MARK, OWN, Said, said_from_bytes
from simulator.errors import HybridTofError

__all__ = ["answers_in", "answers_of", "encoded", "error_of", "more_of"]

Array = NDArray[np.float64]
Texts = list[list[str]]

_STATUS = {int(status): status.name.lower() for status in Status}


def answers_of(said: Said) -> list[bytes]:
    """Return the answers to frames as JSON, without line ends; what is nan is null.

    The texts of all numbers are made in one go and laid between those that answers have in common:
    an object a frame costs several times as much.
    """
    n, table = len(said.sequence), said.table
    flags = np.where(said.misfit, "true", "false").tolist()
    kinds = list(map(_STATUS.__getitem__, said.status.tolist()))
    heads = [_texts(said.sequence), _texts(said.time_s), kinds]
    tails = [flags, list(said.more) or [""] * n]
    counts = np.unique(said.hypotheses).tolist()
    if len(counts) == 1:
        return _of_one_count(counts[0], heads, table, tails)
    answers = np.empty(n, dtype=object)
    for count in counts:
        which = np.flatnonzero(said.hypotheses == count)
        at = which.tolist()
        some = [[[column[i] for i in at] for column in texts] for texts in (heads, tails)]
        answers[which] = _of_one_count(count, some[0], table[:, which], some[1])
    found: list[bytes] = answers.tolist()
    return found


def _of_one_count(count: int, heads: Texts, table: Array, tails: Texts) -> list[bytes]:
    """Return the answers to frames with equally many hypotheses."""
    order = [*range(5), *range(OWN, OWN + 3 * count), 5, 6, 7, 8]
    every, n = _texts(table[order].ravel()), table.shape[1]
    *columns, latency = [every[k * n : (k + 1) * n] for k in range(len(order))]
    misfit, more = tails
    return _laid(count, [*heads, *columns, misfit, latency, more])


_HEAD = '{"sequence":', ',"time_s":', ',"status":"', '","range_m":', ',"sd_m":'
_PARTS = ',"sd_parts_m":{"noise":', ',"scene":', ',"model":'
_HYPOTHESIS = '{"range_m":', ',"sd_m":', ',"weight":'
_TAIL = ',"outlier":', ',"rate_m_s":', ',"misfit":', ',"latency_s":', ""


def _laid(count: int, columns: Texts) -> list[bytes]:
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


def _texts(values: NDArray[Any]) -> list[str]:
    """Return the JSON texts of numbers."""
    # what was kept begins at any byte, and orjson reads whole numbers
    values = np.require(values, requirements=["C", "A"])
    text = orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].decode("ascii").split(",")


def more_of(also: Sequence[dict[str, Any] | None] | None) -> tuple[str, ...]:
    """Return the texts of further members, as `Said` has them."""
    if also is None:
        return ()
    return tuple("," + encoded(of)[1:-1].decode() if of else "" for of in also)


def answers_in(kept: bytes) -> dict[int, bytes]:
    """Return answers by their numbers, from what a store keeps of them: numbers, or lines."""
    if kept.startswith(MARK):
        said = said_from_bytes(kept)
        return dict(zip(said.sequence.tolist(), answers_of(said), strict=True))
    return {orjson.loads(line)["sequence"]: line for line in kept.splitlines()}


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
