"""What may import what: one row a folder, and no folder without a row.

A folder's files may import themselves and whatever lies in a folder, or is a module, that its row
names; everything may import `simulator`, save its optics, which stand apart. A row is for the files
of the folder alone: folders within it have rows of their own.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("simulator", "inference", "service", "hybridtof")

_TEMPLATE = "inference.technique inference.known inference.estimates"
_POSTERIOR = "inference.posterior inference.density inference.frame inference.identifiability"
_OF_FITS = f"inference.realtime.net inference.frame {_TEMPLATE}"
_FITS = f"inference.fits inference.realtime inference.density inference.frame {_TEMPLATE}"

# folder: what its files may import besides one another
ALLOWED: dict[str, str] = {
    "simulator": "simulator.optics",
    "simulator/priors": "",
    "simulator/optics": "simulator.optics",
    "simulator/optics/emitters": "simulator.optics",
    "simulator/optics/figures": "simulator.optics",
    "inference": "inference.frame inference.realtime inference.fits",
    "inference/frame": "",
    "inference/density": "inference.frame",
    "inference/identifiability": "inference.frame",
    "inference/realtime": f"inference.realtime inference.frame {_TEMPLATE}",
    "inference/realtime/solving": "inference.realtime inference.frame",
    "inference/realtime/solving/curves": "inference.realtime.solving",
    "inference/realtime/techniques": f"inference.realtime inference.frame {_TEMPLATE}",
    "inference/fits": _FITS,
    "inference/fits/likelihood": "inference.density inference.frame inference.identifiability "
    "inference.known inference.realtime.turns",
    "inference/fits/answer": f"inference.fits.likelihood {_OF_FITS} inference.identifiability",
    "inference/fits/linear": f"inference.fits.likelihood inference.fits.answer {_OF_FITS}",
    "inference/fits/techniques": f"{_FITS} inference.identifiability",
    "inference/posterior": f"{_POSTERIOR} inference.fits inference.assumptions",
    "inference/posterior/answer": _POSTERIOR,
    "inference/posterior/criticism": _POSTERIOR,
    "inference/posterior/sampling": "inference.density inference.frame",
    "inference/posterior/selection": (
        "inference.posterior.sampling inference.density inference.frame"
    ),
    "inference/posterior/stages": _POSTERIOR,
    "inference/self_calibration": "inference.tracking inference.posterior inference.estimates "
    "inference.frame",
    "inference/tracking": f"{_POSTERIOR} inference.estimates",
    "service": "service inference simulator.optics",
    "service/adapters": "service.errors",
    "service/answers": "service inference",
    "service/border": "service",
    "service/c_export": "service.messages inference",
    "service/commands": "service inference",
    "service/demo": "service inference",
    "service/exports": "service.fold service.json_text inference",
    "service/messages": "service inference",
    "service/report": "service inference simulator.optics",
    "service/routes": "service inference",
    "service/store": "service",
    "service/store/migrations": "service.store",
    "service/store/migrations/versions": "",
    "service/streams": "service inference",
    "service/warm": "service inference",
    "hybridtof": "inference service.frame_files service.cli",
}


def imported(path: Path) -> list[str]:
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return [name for name in names if name.split(".")[0] in (*PACKAGES, "tests", "benchmarks")]


def folder_of(name: str) -> str:
    """Return the deepest folder that holds what is imported."""
    folder = Path()
    for part in name.split("."):
        if not (ROOT / folder / part).is_dir():
            break
        folder /= part
    return folder.as_posix()


def may(folder: str, name: str) -> bool:
    """Tell whether the files of a folder may import a name."""
    there = folder_of(name)
    if there in (folder, "simulator", "simulator/priors"):
        return True
    return any(name == row or name.startswith(row + ".") for row in ALLOWED[folder].split())


def test_every_folder_has_a_row_and_every_row_a_folder() -> None:
    folders = {
        path.parent.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
    }
    assert folders == set(ALLOWED)


@pytest.mark.parametrize("folder", ALLOWED)
def test_a_folder_imports_only_what_its_row_names(folder: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted((ROOT / folder).glob("*.py"))
        for name in imported(path)
        if not may(folder, name)
    ]
    assert wrong == []


@pytest.mark.parametrize("folder", ALLOWED)
def test_a_row_names_nothing_above_its_folder(folder: str) -> None:
    """The order of the three layers, whatever the rows say."""
    above = {
        "simulator": ("inference", "service", "hybridtof"),
        "inference": ("service", "hybridtof"),
        "service": ("hybridtof",),
        "hybridtof": (),
    }[folder.split("/")[0]]
    assert not [row for row in ALLOWED[folder].split() if row.split(".")[0] in above]


def test_what_a_row_names_exists() -> None:
    for row in {row for rows in ALLOWED.values() for row in rows.split()}:
        at = ROOT / row.replace(".", "/")
        assert at.is_dir() or at.with_suffix(".py").is_file(), row
