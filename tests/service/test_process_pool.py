"""The pool with real processes: deaths, refusals, threads, the end."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from service import process_pool, worker_process
from service.errors import OverdueError, WorkerDiedError
from service.process_pool import ProcessPool
from service.process_watch import ended_by_itself
from service.worker import THREAD_VARIABLES
from simulator.errors import InvalidInputError


def _pid(_: int) -> int:
    time.sleep(0.05)
    return os.getpid()


def _environment() -> dict[str, str | None]:
    return {name: os.environ.get(name) for name in THREAD_VARIABLES}


def _die(path: str, times: int, by: int) -> int:
    mark = Path(path)
    deaths = len(mark.read_text()) if mark.exists() else 0
    if deaths < times:
        mark.write_text("x" * (deaths + 1))
        os.kill(os.getpid(), by)
    return deaths


def _spin() -> None:
    while True:
        pass


def _refuse() -> None:
    raise InvalidInputError.at("/a", "is wrong")


def _exit() -> None:
    os._exit(3)


def test_runs_on_other_processes_of_one_thread() -> None:
    with ProcessPool(2) as pool:
        pids = set(pool.map(_pid, range(8)))
        assert os.getpid() not in pids
        assert len(pids) <= 2
        assert pool.submit(_environment).result() == dict.fromkeys(THREAD_VARIABLES, "1")


def test_death_costs_one_task_its_time(tmp_path: Path) -> None:
    with ProcessPool(2) as pool:
        others = [pool.submit(_pid, i) for i in range(4)]
        assert pool.submit(_die, str(tmp_path / "mark"), 2, signal.SIGSEGV).result() == 2
        assert all(other.result() for other in others)


def test_signals_from_outside_are_not_the_task_s_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert process_pool._DEATHS >= 20
    monkeypatch.setattr(process_pool, "_LONGEST_PAUSE_S", 0.0)
    with ProcessPool(1) as pool:
        assert pool.submit(_die, str(tmp_path / "mark"), 5, signal.SIGKILL).result() == 5


@pytest.mark.parametrize(("code", "own"), [(0, 1), (3, 1), (-11, 1), (-6, 1), (-9, 0), (-15, 0)])
def test_whose_fault_an_end_is(code: int, own: int) -> None:
    assert ended_by_itself(code) == bool(own)


def test_task_that_always_kills_is_given_up() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(WorkerDiedError, match="ended 3 processes, last: exit code 3"):
            pool.submit(_exit).result()
        assert pool.submit(_pid, 0).result()


def test_task_that_takes_more_than_its_limit_is_given_up() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(WorkerDiedError, match="processor time"):
            pool.submit_within(0.1, _spin).result()
        assert pool.submit(_pid, 0).result()


def _compile_and_spin() -> None:
    """Never compile, nor compute, for long at a time."""
    from simulator.processor_time import _watch

    while True:
        _watch.begin()
        _watch.end()
        until = time.process_time() + 0.02
        while time.process_time() < until:
            pass


def _count(to: int, dies: str) -> Generator[int, None, int]:
    """Count, and die once on the way where there is no mark yet."""
    for number in range(to):
        yield number
        if dies and number == 1 and not Path(dies).exists():
            Path(dies).touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return to


def _count_and_spin(to: int, pid: str) -> Generator[int, None, int]:
    yield from range(to)
    Path(pid).write_text(str(os.getpid()))
    while True:
        pass


def _count_and_refuse() -> Generator[int, None, int]:
    yield 0
    raise InvalidInputError.at("/b", "is wrong")


def test_parts_are_told_once_each(tmp_path: Path) -> None:
    with ProcessPool(1) as pool:
        assert pool.submit_in_parts(9.0, _count, 3, "").result() == [0, 1, 2, 3]
        again = pool.submit_in_parts(9.0, _count, 3, str(tmp_path / "died")).result()
        assert (tmp_path / "died").exists()
        assert again == [0, 1, 2, 3]
        with pytest.raises(InvalidInputError, match="/b: is wrong"):
            pool.submit_in_parts(9.0, _count_and_refuse).result()
        assert pool.submit_in_parts(9.0, _count, 0, "").result() == [0]


def test_parts_that_were_told_outlive_what_takes_too_long(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    with ProcessPool(1) as pool:
        for told in (3, 0):
            with pytest.raises(OverdueError, match="processor time") as overdue:
                pool.submit_in_parts(0.1, _count_and_spin, told, str(pid)).result()
            assert overdue.value.parts == tuple(range(told))
            with pytest.raises(ProcessLookupError):
                os.kill(int(pid.read_text()), 0)
        with pytest.raises(OverdueError) as plain:
            pool.submit_once(0.1, _spin).result()
        assert plain.value.parts == ()


def test_each_compiling_is_no_new_beginning() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(OverdueError, match="processor time"):
            pool.submit_once(0.5, _compile_and_spin).result()
        assert pool.submit(_pid, 0).result()


def test_stopped_process_is_replaced() -> None:
    with ProcessPool(1, stall_s=1.0) as pool:
        stopped = pool.submit(_pid, 0).result()
        os.kill(stopped, signal.SIGSTOP)
        assert pool.submit(_pid, 0).result() != stopped


def test_abandoned_task_makes_room_at_once() -> None:
    with ProcessPool(1) as pool:
        running, waiting = pool.submit(time.sleep, 3600), pool.submit(time.sleep, 3600)
        while not running.running() or not pool.pids:
            time.sleep(0.01)
        pool.abandon(waiting)
        pool.abandon(running)
        assert pool.submit(_pid, 0).result()
        assert waiting.cancelled()
        with pytest.raises(WorkerDiedError, match="given up"):
            running.result()


def test_exceptions_come_back() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(Exception, match="/a: is wrong"):
            pool.submit(_refuse).result()
        # the words before that differ between versions of Python
        with pytest.raises(Exception, match="local object"):
            pool.submit(lambda: None).result()
        with pytest.raises(TypeError):
            pool.submit(_pid, _=1)
        assert pool.submit(_pid, 0).result()


def test_end_does_not_wait_for_a_task() -> None:
    pool = ProcessPool(1)
    running = pool.submit(time.sleep, 3600)
    waiting = pool.submit(time.sleep, 3600)
    while not running.running() or not pool.pids:
        time.sleep(0.01)
    pool.shutdown(cancel_futures=True)
    with pytest.raises(WorkerDiedError):
        running.result()
    with pytest.raises(CancelledError):
        waiting.result()
    with pytest.raises(RuntimeError):
        pool.submit(_pid, 0)
    assert not multiprocessing.active_children()


def test_task_given_up_while_its_process_is_started_is_not_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """There is no process to be ended yet, and the task would run to its limit."""
    begun, go_on = threading.Event(), threading.Event()

    class Slow(worker_process.WorkerProcess):
        def __init__(self) -> None:
            begun.set()
            assert go_on.wait(60.0)
            super().__init__()

    monkeypatch.setattr(process_pool, "WorkerProcess", Slow)
    with ProcessPool(1, stall_s=3600.0) as pool:
        future = pool.submit(time.sleep, 3600)
        assert begun.wait(60.0)
        pool.abandon(future)
        go_on.set()
        try:
            with pytest.raises(WorkerDiedError, match="given up"):
                future.result(timeout=60.0)
        finally:
            pool.shutdown(cancel_futures=True)


def test_a_second_end_is_one_too() -> None:
    """The first waits for nothing, and its threads are busy still."""
    pool = ProcessPool(2)
    tasks = [pool.submit(time.sleep, 3600) for _ in range(2)]
    while not all(task.running() for task in tasks) or len(pool.pids) < 2:
        time.sleep(0.01)
    pool.shutdown(wait=False)
    second = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
    second.start()
    second.join(60.0)
    left = multiprocessing.active_children()
    for process in left:  # else they keep this one, which waits for them
        process.kill()
    assert not second.is_alive()
    assert not left


def test_a_process_ends_though_nobody_has_ended_its_pool() -> None:
    code = "from service.process_pool import ProcessPool\n"
    code += "if __name__ == '__main__':\n    print(ProcessPool(1).submit(abs, -3).result())\n"
    done = subprocess.run(
        [sys.executable, "-c", code], timeout=60, capture_output=True, text=True, check=True
    )
    assert done.stdout == "3\n"


def _leave_a_thread() -> int:
    """Leave what goes on for longer than anybody waits, and would keep the process."""
    threading.Thread(target=time.sleep, args=(3600,)).start()
    return os.getpid()


def test_process_that_does_not_end_by_itself_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_process, "_GOODBYE_S", 0.2)
    with ProcessPool(1) as pool:
        assert pool.submit(_leave_a_thread).result() in pool.pids
    assert not multiprocessing.active_children()


def test_unused_pool_ends() -> None:
    ProcessPool(2).shutdown()
    assert not multiprocessing.active_children()
