"""Frames as they are given to the command line: columns, standard input, rows that are bad."""

import json
from pathlib import Path

import pytest

from tests.service.conftest import SCENE, SENSOR
from tests.service.said import CSV, SINE_WAVE, Said, given, written


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return written(tmp_path / "scene.json", {"sensor": SENSOR, "scene": SCENE})


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        (CSV, 3),
        ('{"time_s": 0, "w1": 0.02, "w2": 1.7}\n{"time_s": 1, "w1": 0.02, "w2": 1.6}\n', 2),
        ('{"w1": [0.02], "w2": [1.7]}', 1),
        ('{\n "w1": [0.02],\n "w2": [1.7]\n}\n', 1),
    ],
)
def test_frames_from_standard_input(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    scene: Path,
    text: str,
    rows: int,
) -> None:
    given(monkeypatch, text)
    said = Said(capsys, "estimate", "-", "--scene", scene)
    assert (said.code, said.err) == (0, "")
    assert len(said.frames) == rows


def test_standard_input_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scene: Path
) -> None:
    given(monkeypatch, "w1\n1\n")
    said = Said(capsys, "estimate", "-", "--scene", scene)
    assert said.code == 2
    assert "standard input#/w2: is missing" in said.err


@pytest.mark.parametrize(
    ("header", "hint"),
    [
        ("time_s,W1,w2", "#/W1: is not a column: did you mean w1?"),
        ("time,w1,w2", "#/time: is not a column: did you mean time_s?"),
        ("time_ms,w1,w2", "did you mean time_s?"),
        ("w3,w1,w2", "did you mean w1 or w2?"),
        ("object_presnt,w1,w2", "did you mean object_present?"),
        ("0.1,w1,w2", "the first line must name the columns"),
        ("Time;W1;W2", "is the file separated by ';'?"),
        ("time_s;w1;w2", "is the file separated by ';'?"),
        ("time_s\tw1\tw2", "is the file separated by '\\t'?"),
        ("time_s w1 w2", "is the file separated by ' '?"),
        ("W1 (V),w1,w2", "did you mean w1?"),
        ("0.1,w1,w2", "the first line must name the columns. The columns are"),
        ("Late,Total,n", "no column holds readings: found Late, Total, n; a pulsed sensor has w1"),
        ("phase,amplitude,n", "i = amplitude cos(phase) and q = amplitude sin(phase)"),
        ("distance,time_s,n", "one that is known beforehand is known_range_m"),
        ("i,q,n", "i: is not a column of a pulsed sensor: it looks like one of a sine_wave sensor"),
    ],
)
def test_hints(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, header: str, hint: str
) -> None:
    path = written(tmp_path / "f.csv", header + "\n0.1,0.02,1.7\n")
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert (said.code, said.out) == (2, "")
    assert hint in said.err


def test_whether_an_object_is_there_in_digits(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    rows = "0.02,1.7,{}\n0.00,0.0,{}\n"
    answers = []
    for words in (("1", "0"), ("true", "False")):
        path = written(tmp_path / "f.csv", "w1,w2,object_present\n" + rows.format(*words))
        said = Said(capsys, "estimate", path, "--scene", scene, "--technique", "conventional")
        assert said.code == 0
        answers.append([frame["status"] for frame in said.frames])
    assert answers == [["unique", "none"]] * 2
    path = written(tmp_path / "f.csv", "w1,w2,object_present\n" + rows.format("1", "false"))
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert said.code == 2
    assert "#/object_present: mixes 1 and 0 with true and false" in said.err
    rows += "0.02,1.7,0\n"
    path = written(tmp_path / "f.csv", "w1,w2,object_present\n" + rows.format("yes", "TRUE"))
    said = Said(capsys, "infer", path, "--scene", scene)
    assert "object_present must be true or false (in a CSV also 1 or 0), is 'yes'" in said.err
    comma = written(tmp_path / "c.csv", 'w1,w2\n"0,02",1.7\n')
    said = Said(capsys, "infer", comma, "--scene", scene)
    assert "write a point for the decimal comma" in said.err
    path = written(tmp_path / "f.csv", "w1,w2,object_present\n" + rows.format("1", "2"))
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert "object_present must be true or false (in a CSV also 1 or 0), is '2'" in said.err


@pytest.mark.parametrize("name", ["I", "Q"])
def test_hint_for_a_sine_wave(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str
) -> None:
    scene = written(tmp_path / "s.json", {"sensor": SINE_WAVE, "scene": SCENE})
    header = "i,q".replace(name.lower(), name)
    said = Said(capsys, "estimate", written(tmp_path / "f.csv", header + "\n1,1\n"),
                "--scene", scene)  # fmt: skip
    assert f"did you mean {name.lower()}?" in said.err


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".csv", "comment,w1,w2,temperature_c\nfirst,0.02,1.7,1\n"),
        (".ndjson", '{"comment": "first", "w1": 0.02, "w2": 1.7, "temperature_c": 1}\n'),
        (".json", '{"comment": ["first"], "w1": [0.02], "w2": [1.7], "temperature_c": [1]}'),
    ],
)
def test_columns_that_cannot_be_meant_are_passed_over(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, suffix: str, text: str
) -> None:
    path = written(tmp_path / f"f{suffix}", text)
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert said.code == 0
    assert len(said.frames) == 1
    assert "ignored, since they are no columns: comment, temperature_c\n" in said.err
    assert Said(capsys, "estimate", path, "--scene", scene, "--quiet").err == ""


BAD = [
    (
        ".csv",
        "w1,w2\n0.02,1.7\n0.02,abc\n0.03,1.6\n",
        "line 3: w2 must be a finite number, is 'abc'",
    ),
    (".csv", "w1,w2\n0.02,1.7\n0.02\n0.03,1.6\n", "line 3: has 1 fields where the header has 2"),
    (
        ".csv",
        "w1,w2,gain\n0.02,1.7,1\n0.02,1.7,0\n0.03,1.6,1\n",
        "line 3: gain must be above 0, is 0",
    ),
    (
        ".ndjson",
        '{"w1": 0.02, "w2": 1.7}\n{"w1": NaN, "w2": 1}\n{"w1": 0.03, "w2": 1.6}\n',
        "line 2: w1 must be a finite number, is nan",
    ),
    (
        ".ndjson",
        '{"w1": 0.02, "w2": 1.7}\n{"w1": 0.02}\n{"w1": 0.03, "w2": 1.6}\n',
        "line 2: w2 is missing",
    ),
    (
        ".ndjson",
        '{"w1": 0.02, "w2": 1.7}\n{"w1": 0.0\n{"w1": 0.03, "w2": 1.6}\n',
        "line 2: cannot be read: not JSON",
    ),
]


@pytest.mark.parametrize(("suffix", "text", "reason"), BAD)
def test_a_bad_row_is_a_frame_with_a_status(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    scene: Path,
    suffix: str,
    text: str,
    reason: str,
) -> None:
    said = Said(capsys, "estimate", written(tmp_path / f"f{suffix}", text), "--scene", scene,
                "--technique", "conventional")  # fmt: skip
    assert said.code == 0
    first, bad, last = said.frames
    assert bad["status"] == "none"
    assert bad["range_m"] is None
    assert bad["reason"].startswith(reason)
    assert reason in said.err
    lines = text.splitlines(keepends=True)
    del lines[2 if suffix == ".csv" else 1]
    path = written(tmp_path / f"good{suffix}", "".join(lines))
    good = Said(capsys, "estimate", path, "--scene", scene, "--technique", "conventional")
    assert [first, last] == good.frames


def test_rows_that_are_all_bad_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    path = written(tmp_path / "f.csv", "w1,w2\nx,1\n1,y\n")
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert (said.code, said.out) == (2, "")
    assert "f.csv#/w1/0: line 2: must be a finite number" in said.err


@pytest.mark.slow
def test_a_bad_row_of_a_posterior_has_no_range(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    noise = {"read": [1e-5, 1e-3]}
    known = {"sensor": SENSOR | {"noise": noise}, "scene": SCENE}
    frames = tmp_path / "f.csv"
    simulated = Said(capsys, "simulate", "--scene", written(tmp_path / "known.json", known),
                     "--from-m", "0.3", "--to-m", "1", "--frames", "6", "--seed", "1",
                     "--output", frames)  # fmt: skip
    assert simulated.code == 0
    lines = frames.read_text().splitlines()
    unknown = written(
        tmp_path / "s.json", known | {"scene": {"object": {"c0": 0.0769, "c1": -0.123}}}
    )
    options = ("--scene", unknown, "--method", "importance", "--seed", "1")
    good = Said(capsys, "infer", frames, *options)
    written(frames, "\n".join([*lines[:3], "0.5,x,1", *lines[3:]]) + "\n")
    bad = Said(capsys, "infer", frames, *options)
    assert "line 4: w1 must be a finite number" in bad.err
    with_all, with_hole = json.loads(good.out)["range_m"], json.loads(bad.out)["range_m"]
    with_all, with_hole = (each | each.pop("sd_parts") for each in (with_all, with_hole))
    for name, column in with_hole.items():
        assert not column.pop(2), name
        assert column == with_all[name]
