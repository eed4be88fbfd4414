"""``hybridtof track``: the tracker line by line, from files and standard input."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inference.tracking.track import track
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service.conftest import SCENE, SENSOR
from tests.service.said import CSV, Said, given, written


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return written(tmp_path / "scene.json", {"sensor": SENSOR, "scene": SCENE})


def answers(said: Said) -> list[dict[str, Any]]:
    return [json.loads(line) for line in said.out.splitlines()]


def test_noise_below_the_rounding_is_noted_once(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    rows = "".join(f"{0.1 * n:.1f},0.02,{1.7 - 0.01 * n:.2f}\n" for n in range(40))
    path = written(tmp_path / "f.csv", "time_s,w1,w2\n" + rows)
    said = Said(capsys, "track", path, "--scene", scene)
    assert said.err.count("is rounded to") == 1
    assert said.err.startswith("hybridtof: note: w2 is rounded to 0.01")
    assert Said(capsys, "track", path, "--scene", scene, "--quiet").err == ""


def test_track_is_the_tracker(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    simulated = tmp_path / "f.csv"
    Said(capsys, "simulate", "--scene", scene, "--from-m", "0.5", "--to-m", "0.6", "--frames", "12",
         "--duration-s", "1", "--seed", "1", "--output", simulated)  # fmt: skip
    said = Said(capsys, "track", simulated, "--scene", scene)
    assert (said.code, said.err) == (0, "")
    found = answers(said)
    header, *rows = (line.split(",") for line in simulated.read_text().splitlines())
    columns = {name: [float(row[k]) for row in rows] for k, name in enumerate(header)}
    sensor = parse_sensor(SENSOR)
    whole = track(sensor, parse_scene(SCENE), frames_from_columns(sensor, columns))
    assert [line["sequence"] for line in found] == list(range(1, 13))
    assert [line["time_s"] for line in found] == columns["time_s"]
    for i, line in enumerate(found):
        assert line["range_m"] == (None if np.isnan(whole.range_m[i]) else whole.range_m[i])
        assert line["present"] == whole.present[i]
        count = int(np.isfinite(whole.hypotheses_m[i]).sum())
        assert [h["weight"] for h in line["hypotheses"]] == whole.hypotheses_weight[
            i, :count
        ].tolist()
        assert line["latency_s"] > 0
        assert line.keys() == {
            "sequence", "time_s", "status", "range_m", "sd_m", "sd_parts_m", "hypotheses",
            "present", "outlier", "rate_m_s", "misfit", "latency_s",
        }  # fmt: skip
    assert found[-1]["status"] == "unique"
    # as NDJSON and as columns the same
    as_json = written(tmp_path / "f.json", columns)
    again = answers(Said(capsys, "track", as_json, "--scene", scene))
    assert [line | {"latency_s": 0} for line in again] == [
        line | {"latency_s": 0} for line in found
    ]


@pytest.mark.parametrize("suffix", [".csv", ".ndjson", ".json"])
def test_a_mark_of_the_byte_order_is_no_part_of_a_file(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, suffix: str
) -> None:
    """As spreadsheets write it; `estimate` of a CSV took it before."""
    texts = {
        ".csv": "time_s,w1,w2\n0.0,0.02,1.7\n",
        ".ndjson": '{"time_s": 0.0, "w1": 0.02, "w2": 1.7}\n',
        ".json": '{"time_s": [0.0], "w1": [0.02], "w2": [1.7]}',
    }
    system = json.dumps({"sensor": SENSOR, "scene": SCENE})
    marked = "\ufeff" + texts[suffix]
    scene = written(tmp_path / "scene.json", "\ufeff" + system)
    path = written(tmp_path / f"f{suffix}", marked)
    for command in ("track", "estimate"):
        assert Said(capsys, command, path, "--scene", scene).code == 0
        if suffix != ".json":
            given(monkeypatch, marked)
            assert Said(capsys, command, "-", "--scene", scene).code == 0


def test_times_that_go_far_back_say_that_a_new_stream_helps(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scene: Path
) -> None:
    times = 0.0, 1e9, 1e9 - 0.5, 0.1  # one line far ahead, one that is late, and the clock again
    lines = (f'{{"time_s": {time_s}, "w1": 0.003866, "w2": 0.1159}}' for time_s in times)
    given(monkeypatch, "\n".join(lines))
    late, back = (line["error"]["detail"] for line in answers(
        Said(capsys, "track", "-", "--scene", scene))[2:])  # fmt: skip
    assert "new stream" not in late
    assert "a clock was set back" in back
    assert "a new stream" in back


def test_a_bad_line_is_answered_and_changes_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scene: Path
) -> None:
    good = [
        {"time_s": 0.0, "w1": 0.003866, "w2": 0.1159, "camera": "left", "sequence": 10},
        {"time_s": 0.1, "w1": 0.003668, "w2": 0.1078},
    ]
    bad = ['{"time_s": 0.05, "w1": "x", "w2": 1.7, "camera": "left"}', "nope", '{"w1": 1, "w2": 2}',
           '{"time_s": -1, "w1": 0.02, "w2": 1.7}', '{"time_s": 0.05, "W1": 0.02, "w2": 1.7}',
           '{"time_s": 0.05, "w1": 0.02, "w2": 1.7, "sequence": "x"}']  # fmt: skip
    given(monkeypatch, "\n".join([json.dumps(good[0]), *bad, json.dumps(good[1])]))
    said = Said(capsys, "track", "-", "--scene", scene)
    found = answers(said)
    assert said.err == (
        "hybridtof: note: lines that are no frames: 6; their answers have an `error`\n"
    )
    given(monkeypatch, "\n".join(map(json.dumps, good)))
    said = Said(capsys, "track", "-", "--scene", scene)
    first, last = answers(said)
    assert said.err == ""
    assert found[0] | {"latency_s": 0} == first | {"latency_s": 0}
    assert (first["camera"], first["sequence"], last["sequence"]) == ("left", 10, 11)
    assert found[-1] | {"latency_s": 0} == last | {"latency_s": 0, "sequence": 17}
    pointers = [line["error"]["pointer"] for line in found[1:-1]]
    assert pointers == ["/w1", "", "/time_s", "/time_s", "/W1", "/sequence"]
    assert found[1]["camera"] == "left"
    assert all(line["error"]["title"] and line["error"]["type"] for line in found[1:-1])


def test_a_stream_without_a_frame_is_bad_input(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scene: Path
) -> None:
    given(monkeypatch, "time_s,w1,w2\nx,1,2\n")
    said = Said(capsys, "track", "-", "--scene", scene)
    assert said.code == 2
    assert answers(said)[0]["error"]["pointer"] == "/time_s"


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("e.csv", "", "the file is empty; its first line must name the columns"),
        ("b.csv", "\n\n", "the file is empty; its first line must name the columns"),
        ("h.csv", "time_s,w1,w2\n", "the file holds no frame"),
        ("e.ndjson", "", "the file holds no frame"),
        ("e.json", '{"time_s": [], "w1": [], "w2": []}', "the file holds no frame"),
    ],
)
def test_a_file_without_a_frame_is_no_answer(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, name: str, content: str,
    reason: str,
) -> None:  # fmt: skip
    path = written(tmp_path / name, content)
    said = Said(capsys, "track", path, "--scene", scene)
    assert (said.code, said.out, said.err) == (2, "", f"hybridtof: error: {path}: {reason}\n")


def test_nothing_on_standard_input_is_no_answer(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, scene: Path
) -> None:
    given(monkeypatch, "")
    said = Said(capsys, "track", "-", "--scene", scene)
    assert (said.code, said.out) == (2, "")
    assert "standard input: the file is empty" in said.err


def test_lines_begin_with_a_byte_order_mark_and_count_anew(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    """As spreadsheets write files, and as two logs in one file do."""
    rows = [(1, 0.1, 0.003866), (2, 0.2, 0.003866), (1, 0.3, 0.004), (2, 0.2, 0.003866)]
    lines = [f'{{"sequence": {n}, "time_s": {t}, "w1": {w}, "w2": 0.1159}}' for n, t, w in rows]
    cells = [f"{n},{t},{w},0.1159" for n, t, w in rows]
    for name, text in (("f.ndjson", lines), ("f.csv", ["sequence,time_s,w1,w2", *cells])):
        path = written(tmp_path / name, "\ufeff" + "\n".join(text))
        said = Said(capsys, "track", path, "--scene", scene)
        first, second, other, same = answers(said)
        assert "error" not in first
        assert other["error"]["pointer"] == "/sequence"
        assert same == second
        assert "note: lines whose sequence was answered before: 2" in said.err


def test_settings_of_the_tracker(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    frames = written(tmp_path / "f.csv", CSV)
    system = {"sensor": SENSOR, "scene": SCENE, "tracking": {"hypotheses": 1}}
    said = Said(capsys, "track", frames, "--scene", written(tmp_path / "s.json", system))
    assert all(len(line["hypotheses"]) <= 1 for line in answers(said))
    system["tracking"] = {"hypotheses": 0}
    said = Said(capsys, "track", frames, "--scene", written(tmp_path / "s.json", system))
    assert said.code == 2
    assert "s.json#/tracking/hypotheses: " in said.err
    system |= {"scene": SCENE | {"motion": "tangential"}, "tracking": {}}
    said = Said(capsys, "track", frames, "--scene", written(tmp_path / "s.json", system))
    assert (said.code, said.out) == (3, "")
