import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import MalformedError
from service.frame_files import SUFFIXES, form_of, read_frames, read_table, write_frames
from simulator.errors import InvalidInputError
from simulator.frames import frames_from_columns
from simulator.sensor import parse_sensor

finite = st.floats(allow_nan=False, allow_infinity=False)
frames = st.lists(st.tuples(finite, finite, st.booleans()), min_size=1, max_size=80)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("frames")


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(rows=frames)
def test_round_trip_to_the_last_bit(folder: Path, suffix: str, rows: list[Any]) -> None:
    w1, w2, present = (list(column) for column in zip(*rows, strict=True))
    path = folder / f"frames{suffix}"
    write_frames(path, {"w1": w1, "w2": w2, "object_present": present})
    read = read_frames(path)
    assert read.model_fields_set == {"w1", "w2", "object_present"}
    assert (read.w1, read.w2, read.object_present) == (w1, w2, present)
    assert read.w1 is not None
    assert all(math.copysign(1, a) == math.copysign(1, b) for a, b in zip(read.w1, w1, strict=True))


def read(tmp_path: Path, suffix: str, content: str | bytes) -> Any:
    path = tmp_path / f"frames{suffix}"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_frames(path)


def test_csv_as_spreadsheets_write_it(tmp_path: Path) -> None:
    text = "\ufefftime_s, w1 ,w2,object_present\r\n0,1e-3, 2.5 ,TRUE\r\n1,-1,+.5,false\r\n\r\n"
    columns = read(tmp_path, ".csv", text)
    assert columns.time_s == [0.0, 1.0]
    assert columns.w1 == [1e-3, -1.0]
    assert columns.w2 == [2.5, 0.5]
    assert columns.object_present == [True, False]


NULLS = {
    ".csv": "w1,w2,known_range_m,known_range_sd_m\n1,2,0.5,1e-3\n1,2,,\n1,2, nan ,0.1\n",
    ".ndjson": '{"w1":1,"w2":2,"known_range_m":0.5,"known_range_sd_m":1e-3}\n'
    '{"w1":1,"w2":2,"known_range_m":null,"known_range_sd_m":null}\n'
    '{"w1":1,"w2":2,"known_range_m":null,"known_range_sd_m":0.1}\n',
    ".json": '{"w1":[1,1,1],"w2":[2,2,2],"known_range_m":[0.5,null,null],'
    '"known_range_sd_m":[1e-3,null,0.1]}',
}


@pytest.mark.parametrize("suffix", NULLS)
def test_a_byte_order_mark_is_no_text(tmp_path: Path, suffix: str) -> None:
    raw = b"\xef\xbb\xbf" + NULLS[suffix].encode()
    assert read(tmp_path, suffix, raw) == read(tmp_path, suffix, NULLS[suffix])
    assert form_of(raw) == suffix


@pytest.mark.parametrize(
    ("cell", "hint"),
    [
        ("1,5", "'1,5': write a point for the decimal comma"),
        ("0,024", "'0,024': write a point for the decimal comma"),
        # a factor of a thousand, or of one
        ("-1,024", "'-1,024': write no separators of thousands, and a point for a decimal comma"),
        ("1,024,000", "'1,024,000': write no separators of thousands"),
        ("1,024.5", "'1,024.5': write no separators of thousands"),
        ("1,2,3", "'1,2,3'"),
    ],
)
def test_a_comma_in_a_number_has_a_remedy(tmp_path: Path, cell: str, hint: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, ".csv", f'w1,w2\n1,"{cell}"\n')
    assert caught.value.problems[0].message == f"line 2: must be a finite number, is {hint}"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("time_ms", "time_s? Convert milliseconds to seconds."),
        ("t_us", "time_s? Convert microseconds to seconds."),
        ("tns", "time_s? Convert nanoseconds to seconds."),
        ("timestamp_ms", "time_s? Convert milliseconds to seconds."),
        ("Time (ms)", "time_s? Convert milliseconds to seconds."),
        ("known_range_mm", "known_range_m or known_range_sd_m? Convert millimetres to metres."),
        ("displacement_cm", "displacement_m or displacement_sd_m? Convert centimetres to metres."),
        ("Time_s", "time_s?"),
        ("times", "time_s?"),
        ("time", "time_s?"),
        ("W1", "w1?"),
    ],
)
def test_a_name_with_another_unit_says_what_to_convert(
    tmp_path: Path, name: str, hint: str
) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, ".csv", f"{name},w2\n1,2\n")
    (problem,) = caught.value.problems
    assert problem.pointer == f"/{name}"
    assert problem.message.startswith(f"is not a column: did you mean {hint} The columns are")


def test_the_clock_of_something_else_stands_beside_the_times() -> None:
    text = b"timestamp_ms,time_s,w1,w2\n5,1,1,2\n"
    assert read_table(text, ".csv").ignored == ("timestamp_ms",)


def test_a_column_without_a_name_says_so(tmp_path: Path) -> None:
    for header, row in ((",w1,w2", "0,1,2"), ("w1,,w2,", "1,,2,")):
        with pytest.raises(InvalidInputError) as caught:
            read(tmp_path, ".csv", f"{header}\n{row}\n")
        (problem,) = caught.value.problems
        assert "a column without a name" in problem.message
        assert "index=False" in problem.message


@pytest.mark.parametrize("separator", ",;")
def test_a_line_for_spreadsheets_is_to_be_removed(tmp_path: Path, separator: str) -> None:
    with pytest.raises(InvalidInputError, match=r"remove the line sep=$"):
        read(tmp_path, ".csv", f"sep={separator}\nw1,w2\n1,2\n")


def test_integers(tmp_path: Path) -> None:
    assert read(tmp_path, ".ndjson", '{"w1": 1, "w2": 2}\n\n{"w2": 3, "w1": 4}').w2 == [2, 3]
    assert read(tmp_path, ".json", '{"w1": [1], "w2": [2]}').w1 == [1]


@pytest.mark.parametrize("suffix", NULLS)
def test_ranges_that_are_known_or_null(tmp_path: Path, suffix: str) -> None:
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1, 1]}})
    columns = read(tmp_path, suffix, NULLS[suffix])
    assert columns.known_range_m == [0.5, None, None]
    assert columns.known_range_sd_m == [1e-3, None, 0.1]
    frames = frames_from_columns(sensor, columns)
    path = tmp_path / f"again{suffix}"
    write_frames(path, frames.to_columns(sensor))
    again = read_frames(path)
    assert (again.known_range_m, again.known_range_sd_m) == (
        columns.known_range_m,
        columns.known_range_sd_m,
    )
    nothing = columns.model_copy(update={"known_range_m": [None] * 3})
    assert list(frames_from_columns(sensor, nothing).to_columns(sensor)) == ["w1", "w2"]


@pytest.mark.parametrize("odd", ["", "x", True, [1]])
def test_null_is_not_written_otherwise(tmp_path: Path, odd: Any) -> None:
    line = {"w1": 1, "w2": 2, "known_range_m": odd, "known_range_sd_m": 0.1}
    with pytest.raises(InvalidInputError, match="finite number") as caught:
        read(tmp_path, ".ndjson", json.dumps(line))
    assert [p.pointer for p in caught.value.problems] == ["/known_range_m/0"]


ODD = ["nan", "NaN", "inf", "-Infinity", "1e400", "1_000", "", "x", "true", "0x10", "١", "1,5"]


@pytest.mark.parametrize("odd", ODD)
def test_csv_odd_cell(tmp_path: Path, odd: str) -> None:
    with pytest.raises(InvalidInputError, match="line 4: must be a finite number") as caught:
        read(tmp_path, ".csv", f'w1,w2\n1,2\n\n3,"{odd}"\n')
    assert [p.pointer for p in caught.value.problems] == ["/w2/1"]


@pytest.mark.parametrize(
    ("text", "pointer"),
    [
        ("w1,w9\n1,2\n", "/w9"),
        ("w1,w1\n1,2\n", "/w1"),
        ("w1,w2,object_present\n1,2,yes\n", "/object_present/0"),
        ("1,2\n3,4\n", "/1"),
    ],
)
def test_csv_names_the_column(tmp_path: Path, text: str, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, ".csv", text)
    assert caught.value.problems[0].pointer == pointer


@pytest.mark.parametrize(
    ("suffix", "content", "match"),
    [
        (".csv", "", "empty"),
        (".csv", "w1,w2\n1,2,3\n", "line 2 has 3 fields"),
        (".csv", "w1,w2\n1\n", "line 2 has 1 field"),
        (".csv", 'w1,w2\n1,"2\n', "line 2"),
        (".csv", b"w1,w2\n1,\xff\n", "UTF-8"),
        (".ndjson", "", "no frame"),
        (".ndjson", '{"w1": 1}\nnope\n', "line 2 cannot be read: not JSON"),
        (".ndjson", '{"w1": 1}\n[1]\n', "line 2 is not a JSON object"),
        (".ndjson", '{"w1": 1, "w1": 2}\n', "line 1 cannot be read: /w1: the member is repeated"),
        (".json", "{", "not JSON"),
        (".txt", "1 2", ".csv"),
        ("", "1 2", ".csv"),
    ],
)
def test_unreadable(tmp_path: Path, suffix: str, content: str | bytes, match: str) -> None:
    with pytest.raises(MalformedError, match=match):
        read(tmp_path, suffix, content)


@pytest.mark.parametrize(
    ("text", "pointer"),
    [
        ('{"w1": 1, "w2": 2}\n{"w1": 1}', "/w2/1"),
        ('{"w1": 1}\n{"w1": 1, "w2": 2}', "/w2/1"),
        ('{"w1": [1]}', "/w1/0"),
        ('{"w1": NaN}', "/w1/0"),
        ('{"w1": 1e400}', "/w1/0"),
        ('{"w1": "1"}', "/w1/0"),
        ('{"w1": true}', "/w1/0"),
        ('{"w9": 1}', "/w9"),
    ],
)
def test_ndjson_names_the_field(tmp_path: Path, text: str, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, ".ndjson", text)
    assert [p.pointer for p in caught.value.problems] == [pointer]


def test_json_must_hold_columns(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError):
        read(tmp_path, ".json", "[1, 2]")
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, ".json", json.dumps({"w1": [1.0] * 70 + [None]}))
    assert [p.pointer for p in caught.value.problems] == ["/w1/70"]


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_frames(tmp_path / "none.csv")
    with pytest.raises(MalformedError):
        write_frames(tmp_path / "none.txt", {"w1": [1.0]})
