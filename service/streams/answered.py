"""What a stream's lines are answered: one JSON object a line."""

import functools
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from inference.estimates import Status
from service.problems import describe
from service.streams.lines import lines_in
from service.streams.said import MARKS, OWN, Said, said_from_bytes
from simulator.errors import HybridTofError

__all__ = ["answers_in", "encoded", "error_of", "more_of", "text_of"]

_STATUS = {int(status): status.name.lower().encode() for status in Status}
_FLAGS: dict[int, bytes] = {False: b"false", True: b"true"}


def text_of(said: Said) -> bytes:
    """Return the answers to frames as JSON, each with a line end; what is nan is null.

    The texts of all numbers are made in one go and laid between those that answers have in common:
    an object a frame costs several times as much. What is the same in all answers is such a text.
    """
    n, columns = len(said.sequence), _own_columns(said.table[:OWN])
    form, hypotheses = _hypotheses(said)
    kinds = _texts_of(said.status, _STATUS)
    misfit = _texts_of(said.misfit, _FLAGS)
    rows = [_texts(said.sequence), _texts(said.time_s), kinds, *columns[:5], *hypotheses]
    rows += [*columns[5:8], misfit, columns[8]]
    if said.more:
        rows.append([text.encode() for text in said.more])
    alike = tuple(row if isinstance(row, bytes) else b"%b" for row in rows)
    template = _template(form, bool(said.more)) % alike
    return _laid(template, n, [row for row in rows if not isinstance(row, bytes)])


def _texts_of(values: NDArray[Any], names: Mapping[int, bytes]) -> Iterable[bytes] | bytes:
    """Return the names of values, or the one that all have."""
    found = values.tolist()
    if found.count(found[0]) == len(found):
        return names[found[0]]
    return map(names.__getitem__, found)


def _own_columns(table: NDArray[np.float64]) -> list[list[bytes] | bytes]:
    """Return the texts of rows of numbers, or the one of all numbers of a row."""
    first = table[:, :1]
    same = ((table == first) | (np.isnan(table) & np.isnan(first))).all(axis=1)
    # equal, and written in another way
    same &= ~((first[:, 0] == 0.0) & np.signbit(table).any(axis=1))
    one, n = _texts(first.ravel()), table.shape[1]
    many = iter(_texts(table[~same].ravel()) if not same.all() else ())
    return [one[k] if alike else list(islice(many, n)) for k, alike in enumerate(same.tolist())]


def _laid(template: bytes, n: int, rows: Sequence[Iterable[bytes]]) -> bytes:
    """Return n times a template, with the texts of each row in one of its places."""
    pieces = [b""] * (n * len(rows))
    for k, row in enumerate(rows):
        pieces[k :: len(rows)] = row
    return template * n % tuple(pieces)


def _hypotheses(said: Said) -> tuple[bytes, list[list[bytes]]]:
    """Return how the hypotheses of a frame are written, and the texts for its places.

    Those that every frame has are a text for each of their numbers, and what some have beyond them
    is one text of their frame.
    """
    least, *larger = np.unique(said.hypotheses).tolist()
    columns = _columns_of(said, 0, least, slice(None))
    if not larger:
        return b"[%b]" % _list_of(least), columns
    further = np.full(len(said.sequence), b"", dtype=object)
    for count in larger:
        which = np.flatnonzero(said.hypotheses == count)
        form = (b"," if least else b"") + _list_of(count - least) + b"\n"
        texts = _laid(form, len(which), _columns_of(said, least, count, which))
        further[which] = texts.split(b"\n")[:-1]
    return b"[%b%%b]" % _list_of(least), [*columns, further.tolist()]


def _columns_of(said: Said, first: int, last: int, which: Any) -> list[list[bytes]]:
    """Return the texts of the numbers of some of the hypotheses of some frames."""
    table = said.table[OWN + 3 * first : OWN + 3 * last, which]
    if not len(table):
        return []
    texts, n = _texts(table.ravel()), table.shape[1]
    return [texts[k * n : (k + 1) * n] for k in range(len(table))]


@functools.cache
def _list_of(count: int) -> bytes:
    return b",".join([b'{"range_m":%b,"sd_m":%b,"weight":%b}'] * count)


@functools.cache
def _template(hypotheses: bytes, more: bool) -> bytes:
    """Return what answers have in common, %b for each text between."""
    return (
        b'{"sequence":%b,"time_s":%b,"status":"%b","range_m":%b,"sd_m":%b,'
        b'"sd_parts_m":{"noise":%b,"scene":%b,"model":%b},'
        b'"hypotheses":' + hypotheses + b","
        b'"present":%b,"outlier":%b,"rate_m_s":%b,"misfit":%b,"latency_s":%b'
        + (b"%b}\n" if more else b"}\n")
    )


def _texts(values: NDArray[Any]) -> list[bytes]:
    """Return the JSON texts of numbers."""
    # what was kept begins at any byte, and orjson reads whole numbers
    values = np.require(values, requirements=["C", "A"])
    return orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].split(b",")


def more_of(also: Sequence[dict[str, Any] | None] | None) -> tuple[str, ...]:
    """Return the texts of further members, as `Said` has them."""
    if also is None:
        return ()
    return tuple("," + encoded(of)[1:-1].decode() if of else "" for of in also)


def answers_in(kept: bytes) -> dict[int, bytes]:
    """Return answers by their numbers, from what a store keeps of them: numbers, or lines."""
    if kept.startswith(MARKS):
        said = said_from_bytes(kept)
        return dict(zip(said.sequence.tolist(), lines_in(text_of(said)), strict=True))
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
