"""What may import what: the order of the layers, and of the packages within inference."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# each may import itself and those named; what is missing here may import everything below its layer
ALLOWED = {
    "simulator": ["simulator"],
    "inference": ["inference", "simulator"],
    "service": ["service", "inference", "simulator"],
    "inference/frame": ["inference.frame", "simulator"],
    "inference/identifiability": ["inference.identifiability", "inference.frame", "simulator"],
    "inference/realtime": [
        "inference.realtime",
        "inference.frame",
        "inference.technique",
        "inference.known",
        "inference.estimates",
        "simulator",
    ],
    "inference/density": ["inference.density", "inference.frame", "simulator"],
    "inference/fits": [
        "inference.fits",
        "inference.density",
        "inference.frame",
        "inference.identifiability",
        "inference.realtime",
        "inference.technique",
        "inference.known",
        "inference.estimates",
        "simulator",
    ],
    "inference/posterior/sampling": [
        "inference.posterior.sampling",
        "inference.density",
        "inference.frame",
    ],
    "inference/posterior/selection": [
        "inference.posterior.selection",
        "inference.posterior.sampling",
        "inference.density",
        "inference.frame",
    ],
}
OURS = ("simulator", "inference", "service", "tests", "benchmarks")


def imported(path: Path) -> list[str]:
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return [name for name in names if name.split(".")[0] in OURS]


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_what_lies_below_it(package: str) -> None:
    allowed = ALLOWED[package] + (["simulator"] if package.startswith("inference") else [])
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    wrong = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in files
        for name in imported(path)
        if not any(name == prefix or name.startswith(prefix + ".") for prefix in allowed)
    ]
    assert wrong == []
