"""Machine code is kept under a digest of what it is made of, or in memory where nothing can be."""

import ast
import importlib.util
import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import simulator.compiled

ROOT = Path(simulator.compiled.__file__).resolve().parents[1]
DECORATORS = set(simulator.compiled.__all__)
MARK = "from simulator.compiled import compiled"
KERNELS = sorted(
    path
    for package in ("simulator", "inference")
    for path in (ROOT / package).rglob("*.py")
    if "@compiled" in path.read_text() and path.name != "compiled.py"
)


def loaded_from(root: Path) -> ModuleType:
    """Return the module as a tree of its own would have it."""
    spec = importlib.util.spec_from_file_location("a_compiled", root / "simulator" / "compiled.py")
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


TOP = Path("inference") / "density" / "collapsed.py"
"""A file of kernels that use many others."""


def directory_of(root: Path, path: Path = TOP) -> str:
    directory = loaded_from(root)._cache_directory(root / path)
    assert isinstance(directory, str)
    return directory


def used_by(path: Path) -> set[Path]:
    """Return every file of kernels whose names a file of kernels imports, directly or not."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        here = ahead.pop()
        if here in seen or here not in KERNELS:
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


def test_the_directory_exists_and_lies_below_the_one_that_is_asked_for(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = Path(directory_of(tree))
    assert asked.is_dir()
    assert asked.parent == tmp_path / "cache" / "hybridtof"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert directory_of(tree) == str(tmp_path / "xdg" / "hybridtof" / asked.name)


@simulator.compiled.compiled
def twice(x: float) -> float:
    return x + x


@simulator.compiled.compiled
def four_times(x: float) -> float:
    return twice(twice(x))


def test_a_kernel_that_a_kernel_calls_gets_its_way_in_from_python_when_it_is_used() -> None:
    called: Any = twice
    assert four_times(3.0) == 12.0
    assert not called.overloads  # the twin's machine code is kept within the caller's
    assert called.called.targetoptions["no_cpython_wrapper"]
    assert twice(3.0) == 6.0
    assert len(called.overloads) == 1


@simulator.compiled.compiled_for_both
def thrice(x: float, times: int) -> float:
    return 3.0 * x * times


@simulator.compiled.compiled
def nine_times(x: float) -> float:
    return thrice(thrice(x, 0) + thrice(x, 1), 1)


def test_numbers_written_in_a_call_are_no_types_and_both_sides_may_share_machine_code() -> None:
    kernel: Any = thrice
    assert nine_times(2.0) == 18.0
    assert thrice(2.0, 1) == 6.0
    assert len(kernel.overloads) == 1


def half(x: float) -> float:
    return 0.5 * x


def no_home() -> Path:
    raise RuntimeError("Could not determine home directory.")


def test_kernels_work_where_nothing_can_be_written(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "below"))
    module = loaded_from(tree)
    assert module._cache_directory(Path(__file__)) is None
    assert module.compiled(half)(3.0) == 1.5
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    assert loaded_from(tree)._cache_directory(Path(__file__)) is None


def test_machine_code_is_kept_where_it_can_be(tree: Path) -> None:
    module = loaded_from(tree)
    assert module.compiled(half)(3.0) == 1.5
    kept = {
        path.suffix
        for path in Path(module._cache_directory(Path(__file__))).rglob("*")
        if path.is_file()
    }
    assert {".nbi", ".nbc"} <= kept


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
