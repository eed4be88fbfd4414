"""Where machine code is kept: a folder for exactly these sources."""

import ast
import importlib.util
import shutil
import stat
from pathlib import Path
from types import ModuleType

import pytest

from tests.simulator.kernel_files import DECORATORS, KERNELS, ROOT

MARK = "from simulator.compiled import compiled"

TUPLES = {
    path
    for package in ("simulator", "inference")
    for path in (ROOT / package).rglob("*.py")
    if "(NamedTuple):" in path.read_text()
}


def loaded_from(root: Path) -> ModuleType:
    """Return the module as a tree of its own would have it."""
    spec = importlib.util.spec_from_file_location(
        "a_kernel_cache", root / "simulator" / "kernel_cache.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copy the sources, with a cache of their own."""
    root = tmp_path / "tree"
    for package in ("simulator", "inference"):
        shutil.copytree(
            ROOT / package, root / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return root


TOP = Path("inference") / "density" / "frame_integrals.py"
"""A file of kernels that use many others."""


def directory_of(root: Path, path: Path = TOP) -> str:
    folder = loaded_from(root).folder_of(root / path)
    assert folder is not None
    assert folder.writable
    return str(folder.path)


def used_by(path: Path) -> set[Path]:
    """Return every file of kernels or named tuples whose names a file imports, directly or not."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        here = ahead.pop()
        if here in seen or here not in {*KERNELS, *TUPLES}:
            continue
        seen.add(here)
        ahead += [
            ROOT / (node.module.replace(".", "/") + ".py")
            for node in ast.parse(here.read_text()).body
            if isinstance(node, ast.ImportFrom) and node.module
        ]
    return seen


def test_an_edit_changes_the_directory_of_all_that_use_the_file_and_of_no_other(
    tree: Path,
) -> None:
    used = used_by(ROOT / TOP)
    assert 3 < len(used) < len(KERNELS)
    before = directory_of(tree)
    assert directory_of(tree) == before
    for path in KERNELS:
        copy = tree / path.relative_to(ROOT)
        source = copy.read_text()
        copy.write_text(source + "\n# another comment\n")
        assert (directory_of(tree) != before) == (path in used), path
        copy.write_text(source)


def test_named_tuples_that_kernels_take_count(tree: Path) -> None:
    """Their members are found by their places: in another order old machine code would be wrong."""
    curves = Path("inference") / "realtime" / "solving" / "curves"
    taken = tree / curves / "curve.py"
    source = taken.read_text()
    assert MARK not in source
    before = directory_of(tree, curves / "intensity.py")
    taken.write_text(
        source.replace("    c0: float\n    c1: float\n", "    c1: float\n    c0: float\n")
    )
    assert directory_of(tree, curves / "intensity.py") != before


def test_other_files_do_not_change_it(tree: Path) -> None:
    before = directory_of(tree)
    scene = tree / "simulator" / "scene.py"
    scene.write_text(scene.read_text() + "\n# another comment\n")
    (tree / "simulator" / "notes.txt").write_text(MARK)
    assert directory_of(tree) == before


def test_every_module_of_a_package_that_is_imported_from_counts(tree: Path) -> None:
    top = tree / TOP
    top.write_text(top.read_text() + "\nfrom inference.density import gaussian\n")
    before = directory_of(tree)
    new = tree / "inference" / "density" / "new_kernel.py"
    new.write_text(MARK)
    with_new = directory_of(tree)
    new.rename(new.with_name("newer_kernel.py"))
    assert len({before, with_new, directory_of(tree)}) == 3


def test_the_directory_lies_below_the_one_that_is_asked_for(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = Path(directory_of(tree))
    assert asked.parent == tmp_path / "cache" / "hybridtof"
    assert stat.S_IMODE(asked.parent.stat().st_mode) == 0o700
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert directory_of(tree) == str(tmp_path / "xdg" / "hybridtof" / asked.name)


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: str(path.relative_to(ROOT)))
def test_kernels_use_nothing_that_the_digest_does_not_see(path: Path) -> None:
    """A constant of another file is frozen into the machine code: that file must be hashed too."""
    source = path.read_text()
    assert MARK in source
    module = ast.parse(source)
    origin = {
        alias.asname or alias.name: statement.module or ""
        for statement in module.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    for function in module.body:
        if not isinstance(function, ast.FunctionDef):
            continue
        if not any(isinstance(d, ast.Name) and d.id in DECORATORS for d in function.decorator_list):
            continue
        used = {
            node.id
            for statement in function.body
            for node in ast.walk(statement)
            if isinstance(node, ast.Name)
        }
        used -= {argument.arg for argument in ast.walk(function) if isinstance(argument, ast.arg)}
        for name in used & origin.keys():
            package, *_ = origin[name].split(".")
            if package in ("simulator", "inference"):
                there = ROOT / (origin[name].replace(".", "/") + ".py")
                if not there.exists():  # a module of a package, imported by its name
                    there = ROOT / origin[name].replace(".", "/") / f"{name}.py"
                assert MARK in there.read_text(), f"{function.name} uses {name} of {there}"
