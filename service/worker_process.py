"""One worker: a spawned process of one thread, the near end of its pipe, and an eye on it."""

import contextlib
import multiprocessing
import os
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from service.process_watch import ended_by_itself, processor_time
from service.worker import COMPILING, PART, THREAD_VARIABLES, work

__all__ = ["DiedError", "Watch", "WorkerProcess"]

_LOOK_S = 0.5
# what a process may take until it has a task: it imports what the task needs
_IMPORTS_S = 15.0
# what one that has answered may take to end, before it is ended
_GOODBYE_S = 10.0
_environment_lock = threading.Lock()


class DiedError(Exception):
    """The process ended, or was ended, before it answered.

    Attributes
    ----------
    own : bool
        Whether it was the task's doing.
    overdue : bool
        Whether it was ended because the task took too long.
    """

    def __init__(self, message: str, own: bool, overdue: bool = False) -> None:
        super().__init__(message)
        self.own = own
        self.overdue = overdue


class Watch:
    """What a task may take, and what is known of it while it runs.

    Parameters
    ----------
    limit_s : float
        Processor time after which the process is ended [s]; that of compiling does not count.
    stall_s : float
        Time without any processor time after which it is ended [s]: it was stopped, or waits for
        what never comes.

    again : bool
        Whether a task that took too long is run again.
    in_parts : bool
        Whether the task is a generator: its result is a list of what it told and what it returned.

    Attributes
    ----------
    compiling : bool
        Whether machine code is being made.
    parts : list
        What the task has told of its answer until now.
    """

    def __init__(
        self, limit_s: float, stall_s: float, again: bool = True, in_parts: bool = False
    ) -> None:
        self.limit_s = limit_s
        self.stall_s = stall_s
        self.again = again
        self.in_parts = in_parts
        self.compiling = False
        self.parts: list[Any] = []


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that are started inside inherit the limit of one thread."""
    with _environment_lock:
        before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
        os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


class WorkerProcess:
    """A process that runs one task at a time.

    It ends with the thread that made it (`service.parent_death`).
    """

    process: SpawnProcess
    pipe: "Connection[object, object]"

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=work, args=(far,), daemon=True)
        with _one_thread_each():
            self.process.start()
        far.close()  # so that the process's death is the end of the pipe

    @property
    def pid(self) -> int:
        """Its number."""
        assert self.process.pid is not None  # noqa: S101  (it was started)
        return self.process.pid

    def ask(self, task: object, watch: Watch) -> tuple[bool, Any]:
        """Run a task; return whether it succeeded, and its result or exception.

        Raises
        ------
        DiedError
            Where there is no answer to be had; the process has ended then.
        """
        watch.parts = []
        try:
            self.pipe.send(task)
            self._await(watch, watch.limit_s + _IMPORTS_S)
            spent_s = 0.0
            while True:
                answer: Any = self.pipe.recv()
                if answer[0] == COMPILING:
                    watch.compiling = answer[1]
                elif answer[0] == PART:
                    watch.parts.append(answer[1])
                elif answer[0] and watch.in_parts:
                    return True, [*watch.parts, answer[1]]
                else:
                    return bool(answer[0]), answer[1]
                spent_s += self._await(watch, watch.limit_s - spent_s)
        except (EOFError, OSError):
            self.process.join(_LOOK_S)
            own = ended_by_itself(self.process.exitcode)
            self.end(kill=True)
            raise DiedError(f"exit code {self.process.exitcode}", own) from None
        finally:
            watch.compiling = False

    def _await(self, watch: Watch, left_s: float) -> float:
        """Wait until there is something to receive; return the processor time that counts [s].

        On a loaded machine wall time tells nothing: what runs at all takes processor time.
        """
        began = self._clock()
        seen, since = began, time.monotonic()
        while left_s < 0.0 or not self.pipe.poll(_LOOK_S):
            used, now = self._clock(), time.monotonic()
            if used > seen:
                seen, since = used, now
            if watch.compiling:
                began = used
            if used - began > left_s:
                self.end(kill=True)
                message = f"more than {watch.limit_s:.0f} s of processor time"
                raise DiedError(message, own=True, overdue=True)
            if now - since > watch.stall_s:
                self.end(kill=True)
                raise DiedError(f"stood still for {watch.stall_s:.0f} s", own=False)
        return 0.0 if watch.compiling else self._clock() - began

    def _clock(self) -> float:
        used = processor_time(self.pid)
        return time.monotonic() if used is None else used

    def end(self, kill: bool) -> None:
        """End the process: with its task, or when it has answered."""
        if kill:
            self.process.kill()
        self.pipe.close()
        self.process.join(_GOODBYE_S)
        if self.process.exitcode is None:  # what it computed with has left something that runs on
            self.process.kill()
            self.process.join()
