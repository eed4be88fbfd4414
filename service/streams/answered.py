"""What a stream's lines are answered: one JSON object a line."""

import functools
import json
import math
from collections.abc import Mapping, Sequence
from itertools import repeat
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.reasons import REASONS, reason_codes
from service.problems import describe
from service.streams.digests import split
from service.streams.laying import Column, json_of, laid
from service.streams.lines import Before, lines_in
from service.streams.said import MARKS, OWN, Said, said_from_bytes
from simulator.errors import HybridTofError

__all__ = ["before_in", "encoded", "error_of", "more_of", "text_of"]

_STATUS = {int(status): status.name.lower().encode() for status in Status}
_REASON = {
    code: b',"reason":%b' % orjson.dumps(text) if text else b"" for code, text in enumerate(REASONS)
}
_PRESENT, _OUTLIER = 5, 6  # rows of `Said.table`: an object is there, the frame is an outlier
_FLAGS: dict[int, bytes] = {False: b"false", True: b"true"}
_HERE = b"%b"  # in what answers have in common, where each has a text of its own


def text_of(said: Said) -> bytes:
    """Return the answers to frames as JSON, each with a line end; what is nan is null."""
    own = [_column(row) for row in said.table[:OWN]]
    form, hypotheses = _hypotheses(said)
    columns = [
        *(said.sequence, said.time_s, _texts_of(said.status, _STATUS), *own[:5], *hypotheses),
        *(*own[5:8], _texts_of(said.misfit, _FLAGS), own[8]),
    ]
    none = Status.NONE in said.status.tolist()  # few batches need reasons
    if none:
        present, outlier = said.table[_PRESENT], said.table[_OUTLIER]
        codes = reason_codes(said.status, present, outlier, said.hypotheses)
        columns.append(_texts_of(codes, _REASON))
    if said.more:
        columns.append([text.encode() for text in said.more])
    return laid(_fixed(form, none + bool(said.more)), columns, len(said.sequence))


def _column(row: NDArray[np.float64]) -> Column:
    """Return numbers, or the text of the one that all of them are."""
    bits = row.view(np.int64)
    return json_of(row[:1])[1:-1] if (bits == bits[0]).all() else row


def _texts_of(values: NDArray[Any], names: Mapping[int, bytes]) -> list[bytes] | bytes:
    """Return the names of values, or the one that all have."""
    found = values.tolist()
    if found.count(found[0]) == len(found):
        return names[found[0]]
    return [names[value] for value in found]


def _hypotheses(said: Said) -> tuple[bytes, list[Column]]:
    """Return how the hypotheses of a frame are written, and what stands in the places for them.

    Those that every frame has are a column for each of their numbers, and what some have beyond
    them is one text of their frame.
    """
    least, *larger = np.unique(said.hypotheses).tolist()
    columns: list[Column] = list(said.table[OWN : OWN + 3 * least])
    if not larger:
        return b"[%b]" % _list_of(least), columns
    further = np.full(len(said.sequence), b"", dtype=object)
    for count in larger:
        which = np.flatnonzero(said.hypotheses == count)
        form = (b"," if least else b"") + _list_of(count - least) + b"\n"
        rows = said.table[OWN + 3 * least : OWN + 3 * count, which]
        further[which] = lines_in(laid(form.split(_HERE), list(rows), len(which)))
    return b"[%b%%b]" % _list_of(least), [*columns, further.tolist()]


@functools.cache
def _list_of(count: int) -> bytes:
    return b",".join([b'{"range_m":%b,"sd_m":%b,"weight":%b}'] * count)


@functools.cache
def _fixed(hypotheses: bytes, more: int) -> list[bytes]:
    """Return what answers have in common, before, between and after their own texts."""
    form = (
        b'{"sequence":%b,"time_s":%b,"status":"%b","range_m":%b,"sd_m":%b,'
        b'"sd_parts_m":{"noise":%b,"scene":%b,"model":%b},'
        b'"hypotheses":' + hypotheses + b","
        b'"present":%b,"outlier":%b,"rate_m_s":%b,"misfit":%b,"latency_s":%b'
        + _HERE * more
        + b"}\n"
    )
    return form.split(_HERE)


def more_of(also: Sequence[dict[str, Any] | None] | None) -> tuple[str, ...]:
    """Return the texts of further members, as `Said` has them."""
    if also is None:
        return ()
    return tuple("," + encoded(of)[1:-1].decode() if of else "" for of in also)


def before_in(kept: bytes) -> dict[int, Before]:
    """Return what was answered by its numbers, from what a store keeps: numbers, or lines."""
    answers, digests = split(kept)
    if answers.startswith(MARKS):
        said = said_from_bytes(answers)
        numbers, lines = said.sequence.tolist(), lines_in(text_of(said))
    else:
        lines = answers.splitlines()
        numbers = [orjson.loads(line)["sequence"] for line in lines]
    before = map(Before, lines, repeat(None) if digests is None else digests)
    return dict(zip(numbers, before, strict=True))


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
