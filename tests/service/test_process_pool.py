"""The pool with real processes: deaths, refusals, threads, the end."""

import multiprocessing
import os
import signal
import time
from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from service.errors import WorkerDiedError
from service.process_pool import ProcessPool
from service.worker import THREAD_VARIABLES
from simulator.errors import InvalidInputError


def _pid(_: int) -> int:
    time.sleep(0.05)
    return os.getpid()


def _environment() -> dict[str, str | None]:
    return {name: os.environ.get(name) for name in THREAD_VARIABLES}


def _die(path: str, times: int) -> int:
    mark = Path(path)
    deaths = len(mark.read_text()) if mark.exists() else 0
    if deaths < times:
        mark.write_text("x" * (deaths + 1))
        os.kill(os.getpid(), signal.SIGKILL)
    return deaths


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
        assert pool.submit(_die, str(tmp_path / "mark"), 2).result() == 2
        assert all(other.result() for other in others)


def test_task_that_always_kills_is_given_up() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(WorkerDiedError):
            pool.submit(_exit).result()
        assert pool.submit(_pid, 0).result()


def test_exceptions_come_back() -> None:
    with ProcessPool(1) as pool:
        with pytest.raises(Exception, match="/a: is wrong"):
            pool.submit(_refuse).result()
        with pytest.raises(Exception, match="pickle"):
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


def test_unused_pool_ends() -> None:
    ProcessPool(2).shutdown()
