"""A pool of spawned processes in which a death costs one task's time and nothing else.

`concurrent.futures.ProcessPoolExecutor` breaks as a whole when one of its processes dies, and
cannot stop one that runs. Here a thread stands for each process: it hands over a task, waits for
the answer, and where the process died instead it starts another and hands the task over again.
"""

import contextlib
import multiprocessing
import os
import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, ParamSpec, TypeVar

from service.errors import WorkerDiedError
from service.worker import THREAD_VARIABLES, work

__all__ = ["ProcessPool"]

P = ParamSpec("P")
R = TypeVar("R")

_ATTEMPTS = 3
_environment_lock = threading.Lock()
_Task = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]


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


class _Worker:
    """One process and the near end of its pipe."""

    process: SpawnProcess
    pipe: "Connection[object, object]"

    def __init__(self) -> None:
        # in the thread that serves it until its end: a worker ends with the thread that started it
        context = multiprocessing.get_context("spawn")
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=work, args=(far,), daemon=True)
        with _one_thread_each():
            self.process.start()
        far.close()  # so that the process's death is the end of the pipe

    def ask(self, task: object) -> tuple[bool, Any]:
        self.pipe.send(task)
        answer: Any = self.pipe.recv()
        return bool(answer[0]), answer[1]

    def end(self, kill: bool) -> None:
        if kill:
            self.process.kill()
        self.pipe.close()
        self.process.join()


class ProcessPool(Executor):
    """Spawned processes of one thread each, behind the interface of `concurrent.futures`.

    Parameters
    ----------
    workers : int
        Number of processes; they start with the first task.

    Notes
    -----
    A task is run again when its process died, so it must be pure. After three deaths its future
    raises `WorkerDiedError`.
    """

    def __init__(self, workers: int) -> None:
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._closed = False
        self._workers: dict[int, _Worker] = {}
        self._threads = [
            threading.Thread(target=self._serve, args=(index,), name=f"worker-{index}", daemon=True)
            for index in range(workers)
        ]
        self._started = False

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the processes that are there."""
        with self._lock:
            return tuple(w.process.pid for w in self._workers.values() if w.process.pid is not None)

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Hand over a pure, picklable function with its arguments.

        Parameters
        ----------
        fn : callable
            Importable by its name.
        *args
            Its arguments; keywords are not taken.

        Returns
        -------
        concurrent.futures.Future
            Of the result.

        Raises
        ------
        RuntimeError
            After `shutdown`.
        TypeError
            For keyword arguments.
        """
        if kwargs:
            raise TypeError("tasks take positional arguments")
        future: Future[R] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("the pool is closed")
            if not self._started:
                self._started = True
                for thread in self._threads:
                    thread.start()
            self._tasks.put((future, fn, args))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; those that run a task first finish it, unless it is cancelled.

        Parameters
        ----------
        wait : bool
            Whether to return only when every process has ended.
        cancel_futures : bool
            Kill the processes, running tasks or not, and cancel all futures.
        """
        with self._lock:
            closed, self._closed = self._closed, True
            started = self._started
        if cancel_futures:
            self._cancel_waiting()
            with self._lock:
                for worker in self._workers.values():
                    worker.process.kill()
        if not closed:
            for _ in self._threads:
                self._tasks.put(None)
        if wait and started:
            for thread in self._threads:
                thread.join()

    def _cancel_waiting(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                task = self._tasks.get_nowait()
                if task is not None:
                    task[0].cancel()

    def _serve(self, index: int) -> None:
        worker: _Worker | None = None
        while (task := self._tasks.get()) is not None:
            future, function, arguments = task
            if not future.set_running_or_notify_cancel():
                continue
            worker = self._answer(index, worker, future, (function, arguments))
        if worker is not None:
            worker.end(kill=False)
        with self._lock:
            self._workers.pop(index, None)

    def _answer(
        self, index: int, worker: _Worker | None, future: Future[Any], task: object
    ) -> _Worker | None:
        """Run one task; return the process that is left for the next."""
        for _ in range(_ATTEMPTS):
            try:
                if worker is None:
                    worker = self._replace(index)
                succeeded, result = worker.ask(task)
            except (EOFError, OSError):  # the process died: the pipe ended
                if worker is not None:
                    worker.end(kill=True)
                    worker = None
                if self._closed:
                    break
            except Exception as error:  # the task cannot be pickled
                future.set_exception(error)
                return worker
            else:
                if succeeded:
                    future.set_result(result)
                else:
                    future.set_exception(result)
                return worker
        message = "the pool was closed" if self._closed else f"a task ended {_ATTEMPTS} processes"
        future.set_exception(WorkerDiedError(message))
        return worker

    def _replace(self, index: int) -> _Worker:
        worker = _Worker()
        with self._lock:
            self._workers[index] = worker
            if self._closed:  # shutdown did not see this process
                worker.process.kill()
        return worker
