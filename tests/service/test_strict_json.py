import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import MalformedError
from service.strict_json import MAX_DEPTH, SHORT, _decode_slowly, check_bulk, decode
from simulator.errors import InvalidInputError
from simulator.frames import FrameColumns
from simulator.validated import parse

json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63)
    | st.floats(allow_nan=False)
    # decode refuses lone surrogates
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner) | st.dictionaries(st.text("ab/~é"), inner),
    max_leaves=20,
)


@given(json_values)
def test_reads_what_the_standard_library_reads(value: Any) -> None:
    assert decode(json.dumps(value).encode()) == value
    assert decode(json.dumps(value, ensure_ascii=False).encode()) == value


def outcome(read: Any, raw: bytes) -> Any:
    try:
        return read(raw)
    except (InvalidInputError, MalformedError) as error:
        return type(error), str(error)


PIECES = r"""{"a": {"b": ,"a": ,"b": [ ] } , 1 -0 1.5e3 1e999 ":" null true NaN
18446744073709551615 36893488147419103232 "\ud800" "é" """
pieces = st.sampled_from(PIECES.split())


@given(st.lists(pieces, max_size=12).map("".join))
def test_fast_and_slow_reading_are_the_same(text: str) -> None:
    """Values, refusals and their words: orjson alone would take a member that comes twice."""
    fast, slow = outcome(decode, text.encode()), outcome(_decode_slowly, text.encode())
    assert repr(fast) == repr(slow)  # so that nan is nan, and 1 is not 1.0


def test_a_member_that_is_repeated_inside_a_column_is_seen() -> None:
    column = [{"a": 1}] * (SHORT + 1)
    with pytest.raises(InvalidInputError, match="number"):
        check_bulk(decode(json.dumps({"w1": column}).encode()))


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"  ",
        b"{",
        b"[1,]",
        b"{'a': 1}",
        b"1 2",
        b"\xff",
        b'{"a": 01}',
        b"[1.]",
        b"\xef\xbb\xbf1",
    ],
)
def test_malformed(raw: bytes) -> None:
    with pytest.raises(MalformedError):
        decode(raw)


def test_depth() -> None:
    fits = b"[" * MAX_DEPTH + b"]" * MAX_DEPTH
    decode(fits)
    decode(b'["' + b"[" * 10 * MAX_DEPTH + b'"]')
    decode(b"[" + b"[]," * 10 * MAX_DEPTH + b"[]]")
    for raw in (b"[" + fits + b"]", b"[" * 10**6, b'{"a":' * 10**5 + b"1" + b"}" * 10**5):
        with pytest.raises(MalformedError, match="deeper"):
            decode(raw)


def test_a_string_that_is_never_closed_is_looked_at_once() -> None:
    """A million quotes, each of which might close it: a search from each would take an hour."""
    with pytest.raises(MalformedError, match="not JSON"):
        decode(b"[" + b"[]," * 2 * MAX_DEPTH + b'"' + b'\\"' * 10**6)


@pytest.mark.parametrize(
    ("raw", "pointer"),
    [(b'{"a": 1, "a": 1}', "/a"), (b'{"x/": [0, {"b": 1, "c": 2, "b": 3}]}', "/x~1/1/b")],
)
def test_repeated_member(raw: bytes, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        decode(raw)
    assert [p.pointer for p in caught.value.problems] == [pointer]


@pytest.mark.parametrize("raw", [rb'"\ud800"', rb'{"\udfff": 1}', rb'{"a": ["\ud800x"]}'])
def test_lone_surrogates(raw: bytes) -> None:
    if raw.startswith(b'"'):
        assert decode(raw) == "\ud800"  # no field to name, and no type takes it
        return
    with pytest.raises(InvalidInputError, match="surrogate"):
        decode(raw)


def test_numbers_without_end() -> None:
    assert decode(b"1" * 5000) == math.inf
    assert decode(b"1e400") == math.inf
    assert math.isnan(decode(b"NaN"))
    for exact in (2**63, -(2**63), 2**64 - 1):
        assert decode(str(exact).encode()) == exact


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf, "1.5", None, True, [1.0], {}])
@pytest.mark.parametrize("position", [0, 17, SHORT])
def test_long_column_names_its_first_odd_entry(odd: Any, position: int) -> None:
    column: list[Any] = [1.0] * SHORT + [2]
    check_bulk({"frames": {"w1": column}})
    column[position] = odd
    column[-1] = odd if position else column[-1]
    with pytest.raises(InvalidInputError) as caught:
        check_bulk({"frames": {"w1": column}})
    (problem,) = caught.value.problems
    # a boolean in front makes it a column of booleans, whose second entry is odd
    assert problem.pointer == f"/frames/w1/{1 if odd is True and position == 0 else position}"


def test_long_column_of_booleans() -> None:
    check_bulk({"object_present": [True, False] * SHORT})


def test_many_members() -> None:
    with pytest.raises(InvalidInputError, match="members"):
        check_bulk({"scene": {str(i): 1 for i in range(SHORT + 1)}})


def test_many_names() -> None:
    check_bulk({"techniques": ["conventional"] * SHORT})
    with pytest.raises(InvalidInputError, match="/techniques: has more than 64 entries"):
        check_bulk({"techniques": ["conventional"] * (SHORT + 1)})


@given(st.lists(st.sampled_from([1.0, 2, True, None, "1", math.nan]), min_size=65, max_size=70))
def test_bulk_check_agrees_with_the_validator(column: list[Any]) -> None:
    """The fast check refuses a column of numbers exactly where pydantic does."""

    def refuses(check: Any) -> bool:
        try:
            check()
        except InvalidInputError:
            return True
        return False

    def slow() -> None:
        parse(FrameColumns, {"w1": column})

    def fast() -> None:
        check_bulk({"w1": column})
        if isinstance(column[0], bool):
            raise InvalidInputError.at("/w1", "booleans")

    assert refuses(slow) == refuses(fast)
