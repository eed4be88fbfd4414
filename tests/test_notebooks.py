"""Notebooks run, are stored without outputs, and their data can be made anew."""

from pathlib import Path

import nbformat
import numpy as np
import pytest

from service.cli import main
from service.frame_files import read_frames

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
NAMES = sorted(path.name for path in NOTEBOOKS.glob("*.ipynb"))


def read(name: str) -> nbformat.NotebookNode:
    path = NOTEBOOKS / name
    notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    return notebook


def test_there_are_notebooks() -> None:
    assert NAMES


@pytest.mark.parametrize("name", NAMES)
def test_stored_without_outputs(name: str) -> None:
    notebook = read(name)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
# the kernel's machinery warns about itself
@pytest.mark.filterwarnings("default")
def test_runs(name: str) -> None:
    from nbclient import NotebookClient

    notebook = read(name)
    resources = {"metadata": {"path": str(NOTEBOOKS)}}
    NotebookClient(notebook, timeout=None, kernel_name="python3", resources=resources).execute()
    text = "".join(
        output.text
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "stream"
    )
    assert "converged: True" in text


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
