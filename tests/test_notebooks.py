"""Notebooks run, hold their truth, keep their outputs, and their data can be made anew."""

import re
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import numpy as np
import pytest

import hybridtof
from benchmarks.notebook_truth import HELD, executed, held_by, with_seeds
from hybridtof import SamplerSettings
from service.cli import main
from service.frame_files import read_frames
from tests.thorough import THOROUGH

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
mpl.use("Agg")
NAMES = sorted(path.name for path in NOTEBOOKS.glob("*.ipynb"))
# beside the one that is shown first; `make notebook-seeds` asks all of them twenty times
_LONG = ("cannot_be_known.ipynb", "field_calibration.ipynb")
# what a notebook needs besides the standard library: httpx comes with the service
ALLOWED = {"hybridtof", "numpy", "matplotlib", "arviz", "httpx"} | sys.stdlib_module_names
DIAGNOSTICS = "posterior_diagnostics.ipynb"


def read(name: str) -> nbformat.NotebookNode:
    path = NOTEBOOKS / name
    notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    return notebook


def printed(notebook: nbformat.NotebookNode) -> str:
    """What its cells print."""
    return "".join(
        output.text
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "stream" and output.name == "stdout"
    )


def check_truth(text: str) -> None:
    """Converged, no misfit, and the truth where the posterior says.

    The frames' errors go together, so that their common error is what has a known law: beyond 3.29
    standard deviations once in a thousand data sets, and the seeds are fixed.
    """
    assert "converged: True" in text
    assert "misfit:    False" in text
    found = re.search(r"common error: ([-+][\d.]+) standard deviations", text)
    assert found is not None
    assert abs(float(found[1])) < 3.29
    counted = re.search(r"truth inside 90 % intervals: (\d+) of (\d+) frames", text)
    assert counted is not None
    assert int(counted[1]) > int(counted[2]) / 2


def quantiles(text: str) -> dict[str, tuple[float, float, float]]:
    """The table of parameters: 5 %, median, 95 %."""
    rows = re.findall(r"^([a-z]+\.[\w.]+) +([-\d.e]+) +([-\d.e]+) +([-\d.e]+) ", text, re.MULTILINE)
    return {name: (float(low), float(middle), float(high)) for name, low, middle, high in rows}


def fewer_draws(**stated: Any) -> SamplerSettings:
    """Settings of a sampler as they are stated, but for more draws than a test needs."""
    if "target_ess" in stated:
        stated["target_ess"] = min(stated["target_ess"], 1000)
    return SamplerSettings(**stated)


def test_there_are_notebooks() -> None:
    assert NAMES


@pytest.mark.parametrize("name", NAMES)
def test_stored_with_outputs(name: str) -> None:
    notebook = read(name)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        assert cell.outputs
        assert {output.output_type for output in cell.outputs} <= {"stream", "display_data"}
        assert all(output.get("name") != "stderr" for output in cell.outputs)
    assert "truth held: True" in printed(notebook)
    if name == DIAGNOSTICS:
        check_truth(printed(notebook))
    assert (NOTEBOOKS / name).stat().st_size < 600_000


@pytest.mark.parametrize("name", NAMES)
def test_goes_in_by_the_front_door(name: str) -> None:
    code = "\n".join(cell.source for cell in read(name).cells if cell.cell_type == "code")
    used = re.findall(r"^\s*(?:import|from) (\w+)", code, re.MULTILINE)
    assert "hybridtof" in used
    assert set(used) <= ALLOWED


@pytest.mark.slow
# the kernel's machinery warns about itself
@pytest.mark.filterwarnings("default")
def test_runs_in_jupyter() -> None:
    """One of them: a kernel takes three times what the cells of the others take in this process."""
    from nbclient import NotebookClient

    notebook = read("two_roots.ipynb")
    resources = {"metadata": {"path": str(NOTEBOOKS)}}
    # a clock knows no load
    NotebookClient(
        notebook, timeout=None, startup_timeout=600, kernel_name="python3", resources=resources
    ).execute()
    assert "truth held: True" in printed(notebook)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning:arviz")  # of its own next version
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.thorough) if name in _LONG else name for name in NAMES],
)
def test_holds_its_truth(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`make notebook-seeds` counts the same intervals over 20 seeds.

    A quarter of the draws of the one that asks for most is compared with all of them.
    """
    if not THOROUGH:
        monkeypatch.setattr(hybridtof, "SamplerSettings", fewer_draws)
    names, said, passed = executed(name)
    assert passed
    assert "truth held: True" in said
    for flags in held_by(name, names).values():
        assert flags.size
        assert flags.mean() > 0.5
    if name == DIAGNOSTICS:
        check_truth(said)
        stored, anew = quantiles(printed(read(name))), quantiles(said)
        assert stored
        assert stored.keys() == anew.keys()
        for parameter, (low, middle, high) in anew.items():
            # a third of a standard deviation: eight standard errors of a median of 1,000 draws
            assert abs(middle - stored[parameter][1]) < 0.1 * (high - low), parameter


def test_other_seeds_change_all_that_is_drawn() -> None:
    moved = with_seeds("simulate(s, c, way, 5)\ninfer(s, SamplerSettings(seed=2))\nread(4)", 3)
    assert moved == "simulate(s, c, way, 3005)\ninfer(s, SamplerSettings(seed=3002))\nread(4)"
    assert set(HELD) == set(NAMES)


def test_frames_are_made_by_the_committed_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The options are those of `make notebook-data`."""
    made = tmp_path / "frames.csv"
    makefile = (NOTEBOOKS.parent / "Makefile").read_text()
    (line,) = [line for line in makefile.splitlines() if "--output notebooks/frames.csv" in line]
    words = line.split(">")[0].split()[1:]
    words = [str(NOTEBOOKS.parent / word) if word.endswith(".json") else word for word in words]
    assert main([*words[: words.index("--output")], "--output", str(made)]) == 0
    capsys.readouterr()
    kept, anew = read_frames(NOTEBOOKS / "frames.csv"), read_frames(made)
    # the noise is seeded; libraries of mathematics differ in the last digits
    for name in ("w1", "w2", "time_s"):
        np.testing.assert_allclose(getattr(kept, name), getattr(anew, name), rtol=1e-12)
