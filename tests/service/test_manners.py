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
from service.plausibility import LOOKED, time_doubts
from tests.service.conftest import SCENE, SENSOR
from tests.service.said import CSV, SINE_WAVE, Said, written


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


def test_a_member_of_a_scene_that_is_nearly_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    document = {"sensor": SENSOR, "scene": SCENE | {"cross_talk": [0.0, 0.0]}}
    path = written(tmp_path / "s.json", document)
    said = Said(capsys, "identifiability", "--scene", path, "--ranges", "0.5")
    assert said.code == 2
    assert "#/scene/cross_talk" in said.err
    assert "did you mean crosstalk?" in said.err


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
    assert len(reasons) == len({item["reason"] for item in document["left_out"]})
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


def test_times_of_reading_are_told_from_times_of_measuring() -> None:
    """Stamps of batches of two to eight; not jitter, missing frames, or one pause."""
    number = np.arange(LOOKED)
    for batch in (2, 3, 5, 8):
        stamps = batch / 30.0 * (number // batch) + 1e-4 * (number % batch)
        (said,) = time_doubts(stamps)
        assert said.startswith("time_s comes in bursts")
    rng = np.random.default_rng(1)
    jitter = number / 30.0 + rng.uniform(0.0, 0.02, LOOKED)
    missing = np.cumsum(np.where(rng.random(LOOKED) < 0.3, 10.0, 1.0)) / 30.0
    pause = 1e-3 * number + np.where(number < 20, 0.0, 10.0)
    for stamps in (number / 30.0, jitter, missing, pause):
        assert not list(time_doubts(np.asarray(stamps, dtype=np.float64)))


def test_frames_in_steps_of_minutes_are_not_doubted(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A sensor in a tank, that reads once a minute."""
    columns = {"i": [0.41, 0.42, 0.44, 0.45, 0.47, 0.48], "q": [0.11, 0.12, 0.13, 0.14, 0.15, 0.16]}
    path = written(tmp_path / "f.json", columns | {"time_s": [60 * k for k in range(6)]})
    scene = written(tmp_path / "s.json", {"sensor": SINE_WAVE, "scene": SCENE})
    assert Said(capsys, "estimate", path, "--scene", scene).err == ""


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
