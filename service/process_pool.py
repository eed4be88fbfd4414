"""A pool of spawned processes in which a death costs one task's time and nothing else.

`concurrent.futures.ProcessPoolExecutor` breaks as a whole when one of its processes dies, and
cannot stop one that runs. Here a thread stands for each process: it hands over a task, waits for
the answer, and where the process died instead it starts another and hands the task over again.
"""

import atexit
import contextlib
import logging
import queue
import threading
from collections.abc import Callable, Generator
from concurrent.futures import Executor, Future
from typing import Any, ParamSpec, TypeVar, cast

from service.errors import OverdueError, WorkerDiedError
from service.worker_process import DiedError, Watch, WorkerProcess

__all__ = ["ProcessPool"]

P = ParamSpec("P")
R = TypeVar("R")

_log = logging.getLogger("hybridtof")
# of its own doing, such as SIGSEGV: the next try will hardly differ
_OWN_DEATHS = 3
# by signals from outside, which are not the task's fault: somebody has to mean it
_DEATHS = 25
_FIRST_PAUSE_S = 0.05
_LONGEST_PAUSE_S = 2.0
# tasks without a limit of their own: an hour of one processor
_LIMIT_S = 3600.0
_Task = tuple[Future[Any], Watch, Callable[..., Any], tuple[Any, ...]]


class ProcessPool(Executor):
    """Spawned processes of one thread each, behind the interface of `concurrent.futures`.

    Parameters
    ----------
    workers : int
        Number of processes; they start with the first task.
    stall_s : float
        How long a process that works on a task may take no processor time [s].

    Notes
    -----
    A task is run again when its process died, so it must be pure. Its future raises
    `WorkerDiedError` after three deaths of its own doing, or 25 by signals from outside.
    """

    def __init__(self, workers: int, stall_s: float = 10.0) -> None:
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._stall_s = stall_s
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._workers: dict[int, WorkerProcess] = {}
        self._running: dict[Future[Any], tuple[int, Watch]] = {}
        self._unwanted: set[Future[Any]] = set()
        self._threads = [
            threading.Thread(target=self._serve, args=(index,), name=f"worker-{index}", daemon=True)
            for index in range(workers)
        ]
        self._started = False

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the processes that are there."""
        with self._lock:
            return tuple(worker.pid for worker in self._workers.values())

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
        return self.submit_within(_LIMIT_S, fn, *args)

    def submit_within(self, limit_s: float, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        """Hand over a task that is to take no more than some processor time.

        Parameters
        ----------
        limit_s : float
            Processor time of the task [s], without that of compiling and of importing what it
            needs; beyond it the process is ended, and the task run again as if it had crashed.
        fn, *args
            As of `submit`.
        """
        return self._submit(Watch(limit_s, self._stall_s), fn, *args)

    def _submit(self, watch: Watch, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        future: Future[R] = Future()
        with self._lock:
            if self._closed.is_set():
                raise RuntimeError("the pool is closed")
            if not self._started:
                self._started = True
                # at its end a process waits for those that it has started, which wait for it
                atexit.register(self.shutdown, cancel_futures=True)
                for thread in self._threads:
                    thread.start()
            self._tasks.put((future, watch, fn, args))
        return future

    def submit_once(self, limit_s: float, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        """Hand over a task as `submit_within` does; beyond it the future raises `OverdueError`."""
        return self._submit(Watch(limit_s, self._stall_s, again=False), fn, *args)

    def submit_in_parts(
        self, limit_s: float, fn: Callable[..., Generator[R, None, R]], /, *args: Any
    ) -> Future[list[R]]:
        """Hand over a task that tells its answer in parts, once.

        Parameters
        ----------
        limit_s : float
            As of `submit_within`; beyond it the future raises `OverdueError`, with the parts that
            were told.
        fn : callable
            A generator; what it returns is the last part.
        *args
            Its arguments.

        Returns
        -------
        concurrent.futures.Future
            Of all parts.
        """
        watch = Watch(limit_s, self._stall_s, again=False, in_parts=True)
        return cast("Future[list[R]]", self._submit(watch, fn, *args))

    def compiling(self, future: Future[Any]) -> bool:
        """Tell whether machine code is being made for a task."""
        with self._lock:
            running = self._running.get(future)
        return running is not None and running[1].compiling

    def abandon(self, future: Future[Any]) -> None:
        """Give a task up, at once: a process that runs it is ended."""
        if future.cancel():
            return
        with self._lock:
            if future in self._running:
                self._unwanted.add(future)
                worker = self._workers.get(self._running[future][0])
                if worker is not None:
                    worker.process.kill()

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
            closed = self._closed.is_set()
            self._closed.set()
            started = self._started
        atexit.unregister(self.shutdown)
        if cancel_futures:
            self._cancel_waiting()
            with self._lock:
                for worker in self._workers.values():
                    worker.process.kill()
        if cancel_futures or not closed:  # which takes away what an earlier end has put there
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
        while (task := self._tasks.get()) is not None:
            future, watch, function, arguments = task
            if not future.set_running_or_notify_cancel():
                continue
            with self._lock:
                self._running[future] = index, watch
            try:
                succeeded, result = self._answer(index, future, watch, (function, arguments))
            finally:
                with self._lock:
                    del self._running[future]
                    self._unwanted.discard(future)
            if succeeded:
                future.set_result(result)
            else:
                future.set_exception(result)
        with self._lock:
            worker = self._workers.pop(index, None)
        if worker is not None:
            worker.end(kill=False)

    def _answer(
        self, index: int, future: Future[Any], watch: Watch, task: object
    ) -> tuple[bool, Any]:
        """Run one task, again and again if need be; tell whether it succeeded, and with what."""
        own, deaths = 0, 0
        while future not in self._unwanted and not self._closed.is_set():
            try:
                return self._worker(index, future).ask(task, watch)
            except DiedError as error:
                with self._lock:
                    self._workers.pop(index, None)
                if future in self._unwanted or self._closed.is_set():
                    break
                if error.overdue and not watch.again:
                    return False, OverdueError(f"it takes {error}", tuple(watch.parts))
                own, deaths = own + error.own, deaths + 1
                _log.warning("a worker died (%s); its task is run again", error)
                if own >= _OWN_DEATHS or deaths >= _DEATHS:
                    message = f"a part of the computation ended {deaths} processes, last: {error}"
                    return False, WorkerDiedError(message)
            except Exception as error:  # the task cannot be pickled
                return False, error
            self._closed.wait(min(_FIRST_PAUSE_S * 2 ** (deaths - 1), _LONGEST_PAUSE_S))
        return False, WorkerDiedError("the task was given up, or the pool was closed")

    def _worker(self, index: int, future: Future[Any]) -> WorkerProcess:
        """Return the process of a thread for a task; to be called in that thread."""
        with self._lock:
            worker = self._workers.get(index)
        if worker is not None:
            return worker
        # started in the thread that serves it until its end: it ends with that thread
        worker = WorkerProcess()
        with self._lock:
            self._workers[index] = worker
            # who closed the pool, or gave the task up, did not see this process
            if self._closed.is_set() or future in self._unwanted:
                worker.process.kill()
        return worker
