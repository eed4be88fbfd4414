"""Machine code on the disk: what processes keep side by side is found again, each kind its own."""

import multiprocessing
import shutil
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

import simulator.compiled
from simulator.kept_code import KeptCode
from simulator.kernel_cache import folder_of

CONTEXT = multiprocessing.get_context("spawn")
KINDS = 8  # of each process


def half(x: float) -> float:
    return 0.5 * x


def _kept() -> Any:
    """Return the files of a function's code, and what its kinds are made of."""
    folder = folder_of(Path(__file__))
    assert folder is not None
    code = KeptCode(half, folder, inner=False)
    code._impl.locator.ensure_cache_path()
    return code._cache_file


def _key(process: int, kind: int) -> tuple[Any, ...]:
    """Return a kind as numba knows it: its types, the machine, and the function."""
    import numba

    types: Any = numba.types
    return (types.float64(types.UniTuple(types.float64, kind + 1), types.IntegerLiteral(process)),)


def _data(key: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return what numba keeps of it, as far as it is looked at, and whose it is."""
    return "code", None, None, key[0], repr(key)


def keep(process: int, pipe: Connection) -> None:
    """Keep kinds, each when it is told to; what is written soon was read a while ago."""
    files = _kept()
    read = files._load_index

    def read_slowly() -> Any:
        listed = read()
        time.sleep(0.01)
        return listed

    files._load_index = read_slowly
    for kind in range(KINDS):
        pipe.send("ready")
        pipe.recv()
        files.save(_key(process, kind), _data(_key(process, kind)))
    pipe.send("done")
    pipe.recv()


def test_what_two_processes_keep_at_once_is_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    pipes = [CONTEXT.Pipe() for _ in range(2)]
    started = [CONTEXT.Process(target=keep, args=(k, far)) for k, (_, far) in enumerate(pipes)]
    for each, (_, far) in zip(started, pipes, strict=True):
        each.start()
        far.close()  # so that the end of a process is that of its pipe
    for _ in range(KINDS):
        assert [near.recv() for near, _ in pipes] == ["ready", "ready"]
        for near, _ in pipes:
            near.send("now")
    assert [near.recv() for near, _ in pipes] == ["done", "done"]
    for near, _ in pipes:
        near.send("go home")
    for each in started:
        each.join()
    files = _kept()
    keys = [_key(process, kind) for process in range(2) for kind in range(KINDS)]
    assert [files.load(key) for key in keys] == [_data(key) for key in keys]


def test_a_kind_keeps_its_file_though_another_listed_itself_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As numba has it both take one number, and the second kind reads the code of the first."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    first, second = _kept(), _kept()
    keys = _key(0, 0), _key(1, 0)
    write = first._save_data

    def write_later(name: str, data: Any) -> None:
        with monkeypatch.context() as early:
            early.setattr(second, "_load_index", dict)  # read before the first was listed
            second.save(keys[1], _data(keys[1]))
        write(name, data)

    monkeypatch.setattr(first, "_save_data", write_later)
    first.save(keys[0], _data(keys[0]))
    assert [_kept().load(key) for key in keys] == [_data(key) for key in keys]


def test_code_of_another_kind_is_not_taken_and_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cache that was spoiled before heals itself."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("KERNELS_COMPILE", "always")

    def hits(argument: float) -> int:
        kernel: Any = simulator.compiled.compiled(half)
        assert kernel(argument) == 0.5 * argument
        return sum(kernel.dispatcher.stats.cache_hits.values())

    assert [hits(3), hits(3.0), hits(3), hits(3.0)] == [0, 0, 1, 1]
    of_integers, of_numbers = sorted(tmp_path.rglob("*.nbc"), key=lambda at: at.stat().st_mtime_ns)
    shutil.copyfile(of_integers, of_numbers)
    assert [hits(3.0), hits(3.0), hits(3)] == [0, 1, 1]
