"""One fault in a copy of the tree, and whether a test fails."""

import contextlib
import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from benchmarks.mutations.faults import Fault, planted

__all__ = ["LONGEST_S", "Result", "copied", "failing_of", "result_of", "try_fault"]

_LEFT_OUT = (".git", ".venv", "__pycache__", "out", "build", "dist", ".*_cache", ".hypothesis")
# seconds after which a fault counts as hanging what it was planted in
LONGEST_S = 900
# of pytest: what the tests need; to load all that is installed takes longer than most tests
_PLUGINS = ("anyio", "hypothesispytest", "xdist")
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
_NAMED, _ALL = "named tests", "fast suite"
# pytest: tests failed, and collecting them did; all else is no verdict on the fault
_PASSED, _NOTICED, _KILLED = 0, (1, 2), (-9, -24, 137)


@dataclasses.dataclass(frozen=True, slots=True)
class Result:
    """What came of a fault.

    Attributes
    ----------
    digest : str
        Of the fault.
    noticed : bool
        Whether a test failed.
    stage : str
        Which tests: those named, or the fast suite.
    by : str
        First test that failed; empty where none did.
    seconds : float
        How long that took [s].
    """

    digest: str
    noticed: bool
    stage: str
    by: str
    seconds: float


@contextlib.contextmanager
def copied(root: Path) -> Iterator[Path]:
    """Yield a copy of a tree, without what is made from it."""
    with tempfile.TemporaryDirectory(prefix="hybridtof-mutations-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(root, tree, ignore=shutil.ignore_patterns(*_LEFT_OUT), symlinks=True)
        yield tree


def _failing(tree: Path, arguments: Sequence[str], cache: Path) -> str | None:
    """Run tests of a tree; return the first that fails, None where none does.

    Raises
    ------
    RuntimeError
        Where pytest came to no verdict, as by a test that is not there.
    """
    # machine code of faults is kept apart; bytecode would be taken for that of the last fault; a
    # test that is named runs, however thorough
    own = {
        "PYTHONPATH": str(tree),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "XDG_CACHE_HOME": str(cache),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "TESTS_THOROUGH": "1",
    }
    plugins = [part for name in (*_PLUGINS, "no:cacheprovider") for part in ("-p", name)]
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=line", *plugins, *arguments]
    hangs = f"hangs: more than {LONGEST_S} s"
    try:
        done = subprocess.run(  # noqa: S603
            command,
            cwd=tree,
            env={**os.environ, **own},
            capture_output=True,
            text=True,
            check=False,
            timeout=4 * LONGEST_S,  # what waits uses no processor time, and others may use it all
        )
    except subprocess.TimeoutExpired:
        return hangs
    if done.returncode == _PASSED:
        return None
    if done.returncode in _KILLED:
        return hangs
    found = _FAILED.search(done.stdout)
    if done.returncode not in _NOTICED or found is None:
        raise RuntimeError(f"pytest ended with {done.returncode}: {done.stdout[-2000:]}")
    return found[1]


def failing_of(tests: Collection[str], tree: Path, cache: Path) -> str | None:
    """Run named tests: of files and folders the fast ones, and single tests however slow."""
    files = sorted(test for test in tests if "::" not in test)
    single = sorted(test for test in tests if "::" in test)
    by = _failing(tree, single, cache) if single else None
    return _failing(tree, ["-m", "not slow", *files], cache) if by is None and files else by


def try_fault(fault: Fault, tree: Path, cache: Path, *, named_only: bool = False) -> Result:
    """Plant a fault in a copy, run the tests that it names, then all fast ones, and mend it."""
    began = time.perf_counter()
    file = tree / fault.file
    whole = file.read_text(encoding="utf-8")
    file.write_text(planted(fault, tree), encoding="utf-8")
    try:
        stage, by = _NAMED, failing_of(fault.tests, tree, cache)
        if by is None and not named_only:
            stage, by = _ALL, _failing(tree, ("-m", "not slow"), cache)
    finally:
        file.write_text(whole, encoding="utf-8")
    seconds = round(time.perf_counter() - began, 1)
    return Result(fault.digest, by is not None, stage, by or "", seconds)


def result_of(fault: Fault, folder: Path) -> Result | None:
    """Return what came of exactly this fault before, if anything did."""
    try:
        found = Result(**json.loads((folder / f"{fault.name}.json").read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError, TypeError):  # none, or one that was cut short
        return None
    return found if found.digest == fault.digest else None
