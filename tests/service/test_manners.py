"""The manners of the command line: what is hinted at, noted, passed over, and said in good time."""

import importlib.util
import json
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from service.commands import COMMANDS
from tests.service.conftest import SCENE, SENSOR
from tests.service.said import CSV, Said, given, written

SINE_WAVE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-3, 1e-3]}}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return written(tmp_path / "scene.json", {"sensor": SENSOR, "scene": SCENE})


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    said = Said(capsys, "--version")
    assert (said.code, said.out) == (0, f"hybridtof {version('hybridtof')}\n")


def commands(capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    """Every command, as the help lists them."""
    listed = Said(capsys, "--help").out
    names = [
        line.split()[0] for line in listed.splitlines() if line[:4] == "    " and line[4] > " "
    ]
    assert len(names) == len(COMMANDS)
    names.remove("reproduce")
    return [[name] for name in names] + [["reproduce", "appendix-b"], ["reproduce", "figures"]]


def test_every_help_has_examples_and_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    for command in commands(capsys):
        said = Said(capsys, *command, "--help")
        assert said.code == 0
        examples = said.out[said.out.index("examples:") :].splitlines()
        assert " ".join(["hybridtof", *command]) in examples[1], command
        assert "exit codes: 0 answered" in examples[-1]
        assert "--quiet" in said.out


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


def test_a_member_of_a_scene_that_is_nearly_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    document = {"sensor": SENSOR, "scene": SCENE | {"cross_talk": [0.0, 0.0]}}
    path = written(tmp_path / "s.json", document)
    said = Said(capsys, "identifiability", "--scene", path, "--ranges", "0.5")
    assert said.code == 2
    assert "#/scene/cross_talk" in said.err
    assert "did you mean crosstalk?" in said.err


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


def test_estimates_as_csv(capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path) -> None:
    frames = written(tmp_path / "f.csv", CSV.replace("0.022", "abc"))
    out = tmp_path / "out.csv"
    techniques = ("--technique", "conventional", "--technique", "intensity")
    shown = Said(capsys, "estimate", frames, "--scene", scene, *techniques)
    said = Said(capsys, "estimate", frames, "--scene", scene, *techniques, "--output", out)
    assert (said.code, said.out) == (0, "")
    header, *rows = out.read_text().splitlines()
    named = "technique,frame,status,range_m,sd_m,roots_m,roots_sd_m,near_fold"
    assert header == f"{named},sd_noise_m,sd_scene_m,sd_model_m,reason"
    results = json.loads(shown.out)["results"]
    for row, (result, index) in zip(
        rows, [(result, index) for result in results for index in range(3)], strict=True
    ):
        cells = row.split(",", 11)
        frame = result["frames"][index]
        assert cells[:3] == [result["technique"], str(index), frame["status"]]
        assert cells[3] == ("" if frame["range_m"] is None else repr(frame["range_m"]))
        assert [float(root) for root in cells[5].split()] == frame["roots_m"]
    assert rows[1].startswith("conventional,1,none,,,,,false,")
    for suffix in (".ndjson", ".json"):
        path = out.with_suffix(suffix)
        assert Said(capsys, "estimate", frames, "--scene", scene, "--output", path).code == 0
    lines = [json.loads(line) for line in out.with_suffix(".ndjson").read_text().splitlines()]
    assert [line["frame"] for line in lines] == [0, 1, 2]
    document = json.loads(out.with_suffix(".json").read_text())
    assert {"technique": lines[0]["technique"], "frame": 0} | document["results"][0]["frames"][
        0
    ] == lines[0]


def test_a_fit_that_misfits_gives_no_range_and_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A plane of which c2 alone is told, and readings that scatter by 30 times their noise."""
    ranges, rng = np.linspace(0.2, 2.0, 12), np.random.default_rng(1)
    scatter = 1.0 + 0.03 * rng.standard_normal(12)
    whole = 0.1 / ranges**2 * scatter
    columns = {"w1": (whole * ranges / 14.9896229).tolist(), "w2": whole.tolist()}
    noise = {"read": [1e-6, 1e-4]}
    system = {"sensor": SENSOR | {"noise": noise}, "scene": {"discrepancy": 0}}
    frames = written(tmp_path / "f.json", columns)
    scene = written(tmp_path / "s.json", system)
    out = tmp_path / "out.csv"
    said = Said(capsys, "estimate", frames, "--scene", scene, "--technique", "object_fit",
                "--output", out)  # fmt: skip
    assert said.code == 0
    assert "note: object_fit gives no ranges: its fit does not explain the frames" in said.err
    assert "(misfit, p value " in said.err
    rows = out.read_text().splitlines()[1:]
    assert len(rows) == 12
    assert all(",none,,,,,false," in row and "(misfit)" in row for row in rows)


def test_what_to_do_first_where_no_technique_serves(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Before all reasons, each of which is said once, for all the techniques that it is of."""
    leak = {"crosstalk": [{"prior": "halfnormal", "sd": 0.1}] * 2}
    scene = written(tmp_path / "s.json", {"sensor": SENSOR, "scene": leak})
    frames = written(tmp_path / "f.csv", "w1,w2\n0.02,1.7\n")
    said = Said(capsys, "estimate", frames, "--scene", scene)
    document = json.loads(said.out)
    first = "take 5 frames without the object (object_present false) and 4 frames of the object"
    assert (said.code, document["results"]) == (3, [])
    assert document["do_first"].startswith(first)
    assert len(document["left_out"]) == 14
    assert said.err.count("\n") == 1
    assert document["do_first"] in said.err
    out = tmp_path / "out.csv"
    said = Said(capsys, "estimate", frames, "--scene", scene, "--output", out)
    advice, *reasons = said.err.splitlines()
    assert first in advice
    assert len(reasons) < 6
    names = [name for line in reasons for name in line.split(": ")[2].split(", ")]
    assert sorted(names) == sorted(item["technique"] for item in document["left_out"])
    assert Said(capsys, "estimate", frames, "--scene", scene, "--quiet").err == ""


def test_ranges_that_frames_would_leave_open_are_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    leak = {"crosstalk": [{"prior": "halfnormal", "sd": 0.1}] * 2}
    scene = written(tmp_path / "s.json", {"sensor": SENSOR, "scene": leak})
    asked = ("identifiability", "--scene", scene, "--ranges", "0.3", "0.5")
    assert "range_m, the scale of all ranges, would be" in Said(capsys, *asked).err
    wide = (*asked, "0.7", "0.9", "1.1", "--empty", "5")
    assert Said(capsys, *wide).err == ""


@pytest.mark.parametrize("command", ["estimate", "simulate"])
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str
) -> None:
    # nothing is read: neither the scene nor the frames are there
    options = {"estimate": ["none.csv"], "simulate": []}[command]
    for path, message in (
        (tmp_path / "x.txt", "not '.txt'"),
        (tmp_path / "no" / "x.csv", "no such"),
    ):
        said = Said(capsys, command, *options, "--scene", "none.json", "--output", path)
        assert said.code == 2
        assert message in said.err


@pytest.mark.parametrize("document", ["file", "sensor", "scene", "frames"])
def test_schema(capsys: pytest.CaptureFixture[str], document: str) -> None:
    schema = json.loads(Said(capsys, "schema", document).out)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    good: dict[str, Any] = {
        "file": {"sensor": SENSOR, "scene": SCENE},
        "sensor": SINE_WAVE,
        "scene": SCENE,
        "frames": {"w1": [1.0], "w2": [2.0]},
    }
    assert validator.is_valid(good[document])
    assert not validator.is_valid(good[document] | {"colour": "red"})
    if document == "file":
        assert json.loads(Said(capsys, "schema").out) == schema


@pytest.mark.parametrize(
    ("sensor", "frames", "doubt"),
    [
        ({"frequency_hz": 20.0}, {}, "frequency_hz 20 gives an unambiguous range of 7.49e+06 m"),
        (
            {"noise": {"read": [1e-6, 1e-6]}},
            {},
            "i is rounded to 0.01, and its stated noise is 1e-06",
        ),
        ({}, {"time_s": [0, 33, 66, 100, 133, 166]}, "in steps of 33: are these milliseconds?"),
        ({}, {"time_s": [1.7e12 + k for k in range(6)]}, "are these milliseconds?"),
    ],
)
def test_doubts(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    sensor: dict[str, Any],
    frames: dict[str, Any],
    doubt: str,
) -> None:
    columns = {"i": [0.41, 0.42, 0.44, 0.45, 0.47, 0.48], "q": [0.11, 0.12, 0.13, 0.14, 0.15, 0.16]}
    path = written(tmp_path / "f.json", columns | frames)
    scene = written(tmp_path / "s.json", {"sensor": SINE_WAVE | sensor, "scene": SCENE})
    plain = written(tmp_path / "plain.json", columns)
    honest = written(tmp_path / "honest.json", {"sensor": SINE_WAVE, "scene": SCENE})
    assert Said(capsys, "estimate", plain, "--scene", honest).err == ""
    said = Said(capsys, "estimate", path, "--scene", scene)
    assert said.code == 0
    assert doubt in said.err
    assert Said(capsys, "estimate", path, "--scene", scene, "--quiet").err == ""


def test_a_pulse_of_100_s_is_doubted(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    system = {"sensor": SENSOR | {"pulse_width_s": 100.0}, "scene": SCENE}
    said = Said(capsys, "identifiability", "--scene", written(tmp_path / "s.json", system),
                "--ranges", "0.5")  # fmt: skip
    assert "pulse_width_s 100 gives an unambiguous range of 1.5e+10 m" in said.err


def test_full_noise_is_not_doubted(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    columns = {"i": rng.normal(0.4, 1e-3, 50).tolist(), "q": rng.normal(0.1, 1e-3, 50).tolist()}
    sensor = SINE_WAVE | {"noise": {"read": [1e-9, 1e-9]}}  # small, but nothing is rounded
    said = Said(capsys, "estimate", written(tmp_path / "f.json", columns), "--scene",
                written(tmp_path / "s.json", {"sensor": sensor, "scene": SCENE}))  # fmt: skip
    assert said.err == ""


@pytest.mark.parametrize("command", ["demo", "report"])
def test_a_missing_matplotlib_is_said_before_the_work(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    command: str,
) -> None:
    monkeypatch.delenv("KERNELS_COMPILE", raising=False)
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, package=None: None if name == "matplotlib" else find(name, package),
    )
    # a file where the folder should be: the work ends before it begins
    out = written(tmp_path / "out", "")
    said = Said(capsys, command, "--out", out)
    assert said.code == 2
    assert said.err.startswith("hybridtof: there will be no picture: it needs matplotlib")
    # the next command in this process compiles no more than it must
    assert "KERNELS_COMPILE" not in os.environ
