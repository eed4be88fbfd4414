"""Batches as columns and as text, beside an object a line."""

import json
import math
import struct
from typing import Any
from unittest import mock

import numpy as np
import orjson
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from inference.estimates import Status
from inference.tracking.reasons import REASONS, reason_codes
from service.errors import MalformedError
from service.streams import laying
from service.streams.answered import before_in, more_of, text_of
from service.streams.forms import JsonLines
from service.streams.number_lines import number_lines
from service.streams.said import OWN, Said, said_from_bytes, said_to_bytes
from simulator.errors import InvalidInputError

_LINES = [
    b'{"sequence": 1, "time_s": 0.0, "w1": 1e-3, "w2": 2}',
    b'{"sequence": 2, "time_s": 0.1, "w1": -0.5, "w2": 2.5E+1}',
    b'{"sequence": 3, "time_s": 0.2, "w1": 0, "w2": 1}',
]


def one_by_one(lines: list[bytes]) -> list[list[tuple[str, Any]]] | None:
    """Return the members of each line, in their order; None where one cannot be read."""
    try:
        return [list(JsonLines().frame_in(line).items()) for line in lines]
    except (MalformedError, InvalidInputError):
        return None


def together(lines: list[bytes]) -> list[list[tuple[str, Any]]] | None:
    found = number_lines(lines)
    if found is None:
        return None
    columns = [[(name, value) for value in found.column(name)] for name in found.names]
    return [list(row) for row in zip(*columns, strict=True)]


def test_lines_of_numbers_are_read_together() -> None:
    assert together(_LINES) == one_by_one(_LINES)
    compact = [line.replace(b" ", b"") for line in _LINES]
    assert together(compact) == one_by_one(compact)
    kinds = [[type(value) for _, value in line] for line in together(_LINES) or []]
    assert kinds == [[type(value) for _, value in line] for line in one_by_one(_LINES) or []]


@st.composite
def _spoilt(draw: st.DrawFn) -> list[bytes]:
    """Some of the lines with some bytes replaced by others that mean something."""
    text = bytearray(b"\n".join(_LINES[: draw(st.integers(1, 3))]))
    other = st.sampled_from([b"", *(bytes([code]) for code in b'0519.eE+-,:{}[]" \n\t\x01\x02w')])
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text)))
        text[at : at + draw(st.integers(0, 2))] = draw(other)
    return bytes(text).split(b"\n")


@given(_spoilt())
@example([b'{"a": 1, "b": 2}', b'{"b": 1, "a": 2}'])
@example([b'{"a": 1, "b": 2}', b'{"a": 1\x02 2}'])
@example([b'{"a": 1, "a": 2}', b'{"a": 1, "a": 2}'])
@example([b'{"a: 5": 1}', b'{"a: 6": 1}'])
@example([b'{"a": 1}', b'1{"a": }'])
@example([b'{"a": 1}', b'{"a": 1},{"a": 2}'])
@example([b'{"a": 1}', b'{"a": }'])
@example([b'{"a": 01}', b'{"a": 1}'])
@example([b'{"a": 1}', b'{"a": 01}'])
@example([b'{"a": 1}', b'{"a": 1e999}'])
@example([b'{"a": -0, "b": 18446744073709551616}'])
def test_what_is_read_together_is_what_each_line_says(lines: list[bytes]) -> None:
    found = together(lines)
    if found is not None:
        assert found == one_by_one(lines)


@pytest.mark.parametrize("line", [b"", b"{}", b"[1]", b"7", b'{"a": "1"}', b'{"a": true}'])
def test_lines_of_other_things_are_left(line: bytes) -> None:
    assert number_lines([line, line]) is None


def obvious(said: Said, at: int) -> bytes:
    """Return the answer to a frame, as an object a frame has it."""
    range_m, sd_m, noise, scene, model, present, outlier, rate, latency = said.table[:OWN, at]
    hypotheses = said.table[OWN : OWN + 3 * int(said.hypotheses[at]), at].reshape(-1, 3)
    names = ("range_m", "sd_m", "weight")
    answer = {
        "sequence": int(said.sequence[at]),
        "time_s": float(said.time_s[at]),
        "status": Status(said.status[at]).name.lower(),
        "range_m": range_m,
        "sd_m": sd_m,
        "sd_parts_m": {"noise": noise, "scene": scene, "model": model},
        "hypotheses": [dict(zip(names, of, strict=True)) for of in hypotheses.tolist()],
        "present": present,
        "outlier": outlier,
        "rate_m_s": rate,
        "misfit": bool(said.misfit[at]),
        "latency_s": latency,
    }
    if said.status[at] == Status.NONE:
        counted = said.hypotheses[at : at + 1]
        told = np.array([present]), np.array([outlier])
        answer["reason"] = REASONS[reason_codes(said.status[at : at + 1], *told, counted)[0]]
    text = orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY)
    return text[:-1] + said.more[at].encode() + b"}" if said.more else text


@st.composite
def _said(draw: st.DrawFn) -> Said:
    n, most = draw(st.integers(1, 5)), draw(st.integers(1, 3))
    counts = draw(st.lists(st.integers(0, most), min_size=n, max_size=n))
    number = st.floats(allow_infinity=False) | st.sampled_from([0.0, 1.0, math.nan])
    values = draw(st.lists(number, min_size=n * (OWN + 3 * most), max_size=n * (OWN + 3 * most)))
    stamp = st.none() | st.fixed_dictionaries({"stamp": st.text(max_size=3) | st.just("100 %b")})
    more = draw(st.none() | st.lists(stamp, min_size=n, max_size=n))
    table = np.array(values).reshape(OWN + 3 * most, n)
    rows = draw(st.lists(st.booleans(), min_size=len(table), max_size=len(table)))
    table[rows] = table[rows, :1]
    return Said(
        np.arange(n, dtype=np.int64) + draw(st.sampled_from([0, 7, 2**53 - 10])),
        np.array(values[:n]),
        np.array(draw(st.lists(st.integers(0, 3), min_size=n, max_size=n)), dtype=np.uint8),
        np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)), dtype=np.bool_),
        np.array(counts, dtype=np.uint8),
        table,
        more_of(more),
    )


@given(_said())
def test_a_batch_of_answers_is_an_object_a_frame(said: Said) -> None:
    lines = [obvious(said, at) for at in range(len(said.sequence))]
    for few in (0, 100):  # by the kernel, and without
        with mock.patch.object(laying, "_FEW", few):
            assert text_of(said) == b"".join(line + b"\n" for line in lines)
    assert [json.loads(line)["sequence"] for line in lines] == said.sequence.tolist()
    kept = said_to_bytes(said)
    assert text_of(said_from_bytes(kept)) == text_of(said)
    assert [of.answer for of in before_in(kept).values()] == lines
    # as it was written before: all numbers of the table
    text = "\n".join(said.more).encode()
    head = struct.pack("<cIIQ", b"\0", len(lines), len(said.table), len(text))
    before = b"".join([head, *(array.tobytes() for array in said[:-1]), text])
    assert [of.answer for of in before_in(before).values()] == lines
