"""The command line `hybridtof reproduce`."""

import subprocess
import sys
from pathlib import Path

import pytest

from service.cli import main

FIGURES = (
    *(f"2-{i}" for i in range(6, 14)),
    *(f"3-{i}" for i in (1, 2, 3, 4, 5, 6, 8, 10, 11, 12)),
    *(f"4-{i}" for i in range(1, 6)),
    "5-1",
    "5-2",
    "A-6",
)


def run(*arguments: str) -> int:
    return main(["reproduce", *arguments])


def test_csv(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("appendix-b", "--system", "pulsed", "--format", "csv") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "code,c0,c1,c2,error"
    assert len(lines) == 109
    assert "W16H16R00T00,1.54E+00,-3.55E-01,9.84E-02,7.06E-05" in lines


def test_table_of_true_rectangles(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("appendix-b", "--system", "sine_wave", "--converged") == 0
    out = capsys.readouterr().out
    assert "true rectangles" in out
    assert "square law" in out  # the rows whose c0 means nothing say so


def test_unknown_figure(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run("figures", "--out", str(tmp_path), "--only", "9-9") == 2
    assert "no figure 9-9" in capsys.readouterr().err


def test_directory_that_cannot_be(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert run("figures", "--out", str(tmp_path / "file" / "x"), "--only", "3-11") == 2
    assert "cannot make" in capsys.readouterr().err


def test_some_figures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert run("figures", "--out", str(tmp_path / "new"), "--only", "3-11", "4-4") == 0
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == [
        "figure_3-11.png",
        "figure_4-4.png",
    ]


@pytest.mark.slow
def test_all_figures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert run("figures", "--out", str(tmp_path), "--format", "svg") == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert {f"figure_{name}.svg" for name in FIGURES} <= names
    assert all(path.stat().st_size > 5000 for path in tmp_path.iterdir())


def test_importing_the_command_does_not_import_plotting() -> None:
    code = (
        "import sys, service.cli;"
        "sys.exit(any(name.startswith('matplotlib') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
