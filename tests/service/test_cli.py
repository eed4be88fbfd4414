"""The command line in this process; what needs a process of its own is in test_server.py."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from service.cli import main
from service.frame_files import read_frames
from tests.service.conftest import FRAMES, SCENE, SENSOR


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"sensor": SENSOR, "scene": SCENE}))
    return path


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    path = tmp_path / "frames.json"
    path.write_text(json.dumps(FRAMES))
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    code = main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_estimate(capsys: pytest.CaptureFixture[str], scene: Path, frames: Path) -> None:
    code, out, err = run(
        capsys, "estimate", frames, "--scene", scene,
        "--technique", "conventional", "--technique", "intensity",
    )  # fmt: skip
    assert (code, err) == (0, "")
    body = json.loads(out)
    assert [result["technique"] for result in body["results"]] == ["conventional", "intensity"]


def test_an_estimate_that_no_technique_serves_is_no_answer(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, frames: Path
) -> None:
    unknown = [{"prior": "normal", "mean": 0.0, "sd": 1.0}] * 2
    path = tmp_path / "still.json"
    path.write_text(
        json.dumps({"sensor": SENSOR, "scene": {"crosstalk": unknown, "motion": "static"}})
    )
    code, out, err = run(capsys, "estimate", frames, "--scene", path)
    body = json.loads(out)
    advice = body["do_first"]
    assert (code, err) == (
        3, f"hybridtof: no ranges; do this first: {advice}\n"
    )  # fmt: skip
    assert advice.startswith("take 5 frames without the object (object_present false), send them")
    assert body["chosen"] is None
    assert any("needs motion" in item["reason"] for item in body["left_out"])


@pytest.mark.parametrize("suffix", [".csv", ".ndjson", ".json"])
def test_a_file_that_opens_but_cannot_be_read_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, suffix: str
) -> None:
    path = tmp_path / f"frames{suffix}"
    path.symlink_to("/proc/self/mem")  # its first page cannot be read
    code, out, err = run(capsys, "estimate", path, "--scene", scene)
    assert (code, out) == (2, "")
    assert str(path) in err
    assert "Traceback" not in err


@pytest.mark.parametrize("suffix", [".csv", ".ndjson", ".json"])
def test_simulate_then_estimate(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, suffix: str
) -> None:
    path = tmp_path / f"made{suffix}"
    options = ("--from-m", "0.2", "--to-m", "2", "--frames", "20", "--spacing", "log")
    code, out, err = run(
        capsys, "simulate", "--scene", scene, *options, "--seed", "1", "--output", path
    )
    assert (code, err) == (0, "")
    body = json.loads(out)
    assert read_frames(path).w1 == body["frames"]["w1"]
    code, out, _ = run(capsys, "estimate", path, "--scene", scene, "--technique", "conventional")
    assert code == 0
    (result,) = json.loads(out)["results"]
    for frame, truth in zip(result["frames"], body["truth"]["range_m"], strict=True):
        # six standard deviations: a false alarm once in 5e7 runs, and the seed is fixed
        assert abs(frame["range_m"] - truth) < 6 * frame["sd_m"]


def test_simulate_from_a_trajectory_file(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path
) -> None:
    path = tmp_path / "trajectory.json"
    path.write_text('{"range_m": [0.5, 0.6]}')
    code, out, _ = run(capsys, "simulate", "--scene", scene, "--trajectory", path)
    assert code == 0
    assert json.loads(out)["truth"]["range_m"] == [0.5, 0.6]
    code, _, err = run(capsys, "simulate", "--scene", scene, "--trajectory", path, "--from-m", "1")
    assert code == 2
    assert "--trajectory" in err


def bad(tmp_path: Path, name: str, content: Any) -> Path:
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_errors_name_file_and_field(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, frames: Path
) -> None:
    system = {"sensor": SENSOR, "scene": SCENE}
    cases: list[tuple[tuple[str | Path, ...], str]] = [
        (("estimate", tmp_path / "none.csv", "--scene", scene), "none.csv: No such file"),
        (("estimate", frames, "--scene", tmp_path / "none.json"), "none.json: No such file"),
        (("estimate", frames, "--scene", bad(tmp_path, "a.json", "{")), "a.json: not JSON"),
        (
            ("estimate", frames, "--scene", bad(tmp_path, "b.json", {"scene": {}})),
            "b.json#/sensor: ",
        ),
        (
            (
                "estimate", frames, "--scene",
                bad(tmp_path, "c.json", system | {"scene": {"object": {"c0": -1}}}),
            ),
            "c.json#/scene/object/c0: must be above 0",
        ),
        (
            ("estimate", bad(tmp_path, "d.csv", "w1,w2\n1,x\n"), "--scene", scene),
            "d.csv#/w2/0: line 2: must be a finite number, is 'x'",
        ),
        (
            ("estimate", bad(tmp_path, "e.csv", "w1\n1\n"), "--scene", scene),
            "e.csv#/w2: is missing",
        ),
        (
            ("estimate", frames, "--scene", scene, "--technique", "magic"),
            "--technique#/0: ",
        ),
        (("simulate", "--scene", scene, "--from-m", "1", "--to-m", "2"), "trajectory#/frames"),
        (
            ("simulate", "--scene", scene, "--from-m", "1", "--to-m", "nan", "--frames", "2"),
            "trajectory#/to_m",
        ),
        (
            ("simulate", "--scene", scene, "--from-m", "1", "--to-m", "2", "--frames", "2",
             "--temperature-k", "290", "310"),
            "trajectory#/temperature_k: is given, and the sensor has no coefficients",
        ),
        (
            ("simulate", "--scene", scene, "--from-m", "1", "--to-m", "2", "--frames", "2",
             "--seed", "-1"),
            "--seed: ",
        ),
        (("infer", frames, "--scene", scene, "--ensembles", "0"), "sampler#/ensembles: "),
        (("infer", frames, "--scene", scene, "--draws", "draws.csv"), "--draws draws.csv: "),
        (("infer", frames, "--scene", scene, "--draws", "no/d.nc"), "--draws no/d.nc: there is no"),
        (
            ("infer", bad(tmp_path, "f.csv", "w1\n1\n"), "--scene", scene),
            "f.csv#/w2: is missing",
        ),
    ]  # fmt: skip
    for arguments, message in cases:
        code, out, err = run(capsys, *arguments)
        assert (code, out) == (2, ""), arguments
        assert message in err, err
        assert err.startswith("hybridtof: error: ")
        assert "Traceback" not in err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["serve", "--port", "70000"],
        ["serve", "--port", "x"],
        ["estimate", "--scene", "x"],
    ],
)
def test_usage(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage: hybridtof" in capsys.readouterr().err


def test_help_lists_commands_and_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    out = capsys.readouterr().out
    for word in ("serve", "simulate", "estimate", "infer", "exit codes"):
        assert word in out


def test_settings_of_serve(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYBRIDTOF_WORKERS", "none")
    code, _, err = run(capsys, "serve")
    assert code == 2
    assert "/HYBRIDTOF_WORKERS: " in err


@pytest.mark.parametrize("url", ["mysql://host/name", "sqlite:////proc/none/jobs.sqlite"])
def test_a_service_without_a_store_does_not_start(
    url: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HYBRIDTOF_DATABASE", url)
    assert main(["serve", "--port", "0"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("hybridtof: error: /HYBRIDTOF_DATABASE: ")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_calibrate_writes_a_scene_that_every_command_takes(
    capsys: pytest.CaptureFixture[str], scene: Path, tmp_path: Path
) -> None:
    _, simulated, _ = run(capsys, "simulate", "--scene", scene, "--from-m", "0.2", "--to-m", "1",
                          "--frames", "6", "--seed", "1")  # fmt: skip
    frames = tmp_path / "frames.json"
    frames.write_text(json.dumps(json.loads(simulated)["frames"]))
    scene, output = tmp_path / "scene.json", tmp_path / "calibrated.json"
    known = {"object": SCENE["object"] | {"c2": {"prior": "lognormal", "median": 0.1, "sigma": 1}}}
    scene.write_text(json.dumps({"sensor": SENSOR, "scene": known | {"discrepancy": 0}}))
    code, out, err = run(capsys, "calibrate", frames, "--scene", scene, "--output", output,
                         "--seed", "1", "--method", "importance")  # fmt: skip
    assert (code, out) == (0, ""), err
    verdict, learnt = "verdict: converged, no misfit", "object.c2: lognormal median 0.1 sigma 1 -> "
    assert f"hybridtof: {verdict}\nhybridtof: {learnt}0.1 +- " in err
    document = json.loads(output.read_text())
    assert document["scene"]["joint"]["unknowns"] == ["object.c2"]
    assert [path.name for path in tmp_path.glob("calibrated*")] == ["calibrated.json"]
    code, out, err = run(capsys, "identifiability", "--scene", output, "--ranges", "0.5")
    assert (code, err) == (0, "")
    others = tmp_path / "others.json"
    code, _, err = run(capsys, "calibrate", frames, "--scene", scene, "--output", others,
                       "--seed", "1", "--method", "importance", "--other-objects")  # fmt: skip
    assert code == 0, err
    assert "joint" not in json.loads(others.read_text())["scene"]
    document["scene"]["calibration"]["converged"] = False
    output.write_text(json.dumps(document))
    code, _, err = run(capsys, "estimate", frames, "--scene", output)
    assert code == 2
    assert "calibrated.json#/scene/calibration/accept: " in err


def test_an_estimate_of_one_frame_imports_what_it_needs(tmp_path: Path) -> None:
    """What the service, the samplers and the compiler take would be most of its time."""
    noise = {"read": [2e-5, 1e-3]}
    system = {"sensor": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise}, "scene": {}}
    (tmp_path / "scene.json").write_text(json.dumps(system))
    (tmp_path / "frames.csv").write_text("w1,w2\n0.0242,0.4230\n")
    code = """
import sys
from service.cli import main
assert main(["estimate", "frames.csv", "--scene", "scene.json", "--quiet"]) == 0
whole = {"alembic", "asyncio", "emcee", "fastapi", "h5py", "httpx", "numba", "platformdirs"}
whole |= {"scipy", "sqlalchemy", "starlette", "uvicorn"}
brought = (whole | {"numpy.ma", "numpy.random"}) & sys.modules.keys()
assert not brought, brought
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("stated", "taken"), [(None, "1"), ("4", "4")])
def test_a_command_computes_by_one_thread(stated: str | None, taken: str) -> None:
    """OpenBLAS reads it as numpy is imported; what a person has stated stays."""
    code = """
import os, sys
from service import cli
assert "numpy" not in sys.modules
sys.argv = ["hybridtof", "schema", "frames"]
cli.main()
print(os.environ["OPENBLAS_NUM_THREADS"], file=sys.stderr)
"""
    variable = "OPENBLAS_NUM_THREADS"
    own = {name: value for name, value in os.environ.items() if name != variable}
    own |= {} if stated is None else {variable: stated}
    done = subprocess.run([sys.executable, "-c", code], env=own, capture_output=True, text=True)
    assert done.stderr == f"{taken}\n"
