"""Processes that need the same machine code: one makes it, the others wait, but not for ever."""

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

from simulator import compile_lock
from simulator.compiled import compiled

CONTEXT = multiprocessing.get_context("spawn")


@compiled
def half(x: float) -> float:
    return 0.5 * x


def compile_it(pipe: Connection, others: bool) -> None:
    """Answer by machine code; the first compiles until another waits for it."""
    from numba.core import event

    listen: Any = event.Listener

    class Listener(listen):  # type: ignore[misc]
        def on_start(self, _: object) -> None:
            pipe.send("compiles")
            if others:
                assert pipe.recv() == "another waits"

        def on_end(self, _: object) -> None:
            pass

    def sleep(_: object) -> None:
        pipe.send("waits")
        time.sleep(0.01)

    register: Any = event.register
    register("numba:compile", Listener())
    compile_lock._sleep = sleep
    compile_lock._MOST_S = float("inf")
    assert half(3.0) == 1.5
    pipe.send("done")


def hold(folder: Path, pipe: Connection) -> None:
    """Hold a lock until told, or until the end."""
    with compile_lock.turn(folder, "a kernel"):
        pipe.send("holds")
        pipe.recv()
    pipe.send("gave it back")
    pipe.recv()


@contextmanager
def process(work: Any, *args: Any) -> Iterator[tuple[Any, Connection]]:
    near, far = CONTEXT.Pipe()
    started = CONTEXT.Process(target=work, args=tuple(far if a is None else a for a in args))
    started.start()
    far.close()
    try:
        yield started, near
    finally:
        started.kill()
        started.join()


def test_two_processes_compile_a_kernel_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    with process(compile_it, None, True) as (_, first):
        assert first.recv() == "compiles"
        with process(compile_it, None, False) as (_, second):
            assert second.recv() == "waits"
            first.send("another waits")
            assert first.recv() == "done"
            said = "waits"
            while said == "waits":
                said = second.recv()
            assert said == "done"  # and not "compiles"


@pytest.mark.parametrize("end", ["killed", "gives it back"])
def test_a_lock_is_free_when_its_holder_gives_it_back_or_dies(
    end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with process(hold, tmp_path, None) as (holder, pipe):
        assert pipe.recv() == "holds"
        looks: list[str] = []

        def sleep(_: object) -> None:
            looks.append("look")
            if end == "killed":
                holder.kill()
                holder.join()
            elif len(looks) == 1:
                pipe.send("enough")
                assert pipe.recv() == "gave it back"

        monkeypatch.setattr(compile_lock, "_sleep", sleep)
        monkeypatch.setattr(compile_lock, "_MOST_S", float("inf"))
        with compile_lock.turn(tmp_path, "another kernel"):
            assert not looks
        with compile_lock.turn(tmp_path, "a kernel"):
            assert len(looks) == 1


def test_who_has_waited_long_enough_compiles_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with process(hold, tmp_path, None) as (_, pipe):
        assert pipe.recv() == "holds"
        monkeypatch.setattr(compile_lock, "_MOST_S", 0.0)
        with compile_lock.turn(tmp_path, "a kernel"):
            pipe.send("it still holds")
            assert pipe.recv() == "gave it back"


def test_where_no_file_can_be_made_there_is_no_lock(tmp_path: Path) -> None:
    with compile_lock.turn(tmp_path / "not there", "a kernel"):
        assert not list(tmp_path.iterdir())
