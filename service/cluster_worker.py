"""What runs in a worker of a Dask cluster: it hands a chunk to a process of its own pool.

Deaths, hangs and limits are judged there (`service.process_pool`), as on one machine: a crash of
the chunk is not one of Dask's worker, and a chunk that nobody wants any more can be ended. Calls
and answers go through Dask as bytes, which it neither searches nor changes.
"""

import functools
import multiprocessing
import pickle
from concurrent.futures import Future, wait
from typing import Any

from service.errors import WorkerDiedError
from service.process_pool import ProcessPool
from service.worker import run

__all__ = ["COMPILING", "chunk"]

COMPILING = "hybridtof-compiling"
"""Topic of events that say for which chunk machine code is being made: (name, True or False)."""

_LOOK_S = 0.2


def _answer(call: bytes) -> bytes:
    return pickle.dumps(run(pickle.loads(call)))  # noqa: S301  (of the service, by TLS)


@functools.cache
def _pool(processes: int) -> ProcessPool:
    # that Dask's own keeper ends this process with itself does not forbid it to have children:
    # they end with it (`service.parent_death`)
    configuration: dict[str, Any] = multiprocessing.current_process().__dict__["_config"]
    configuration["daemon"] = False
    return ProcessPool(processes)


def chunk(name: str, limit_s: float, call: bytes) -> bytes:
    """Run a call in a process that is ended where it takes too long, or nobody waits.

    Parameters
    ----------
    name : str
        By which the service knows the call.
    limit_s : float
        Processor time [s], as of `ProcessPool.submit_within`.
    call : bytes
        Pickled function and arguments.

    Returns
    -------
    bytes
        Pickled: whether it succeeded, and its result or exception.
    """
    from distributed import Status, get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()
    pool = _pool(worker.state.nthreads)
    future = pool.submit_within(limit_s, _answer, call)
    told = False
    while wait((future,), _LOOK_S).not_done:
        if (going := pool.compiling(future)) != told:
            told = going
            worker.log_event(COMPILING, (name, told))
        task = worker.state.tasks.get(key)
        leaving = worker.status in (Status.closing, Status.closed, Status.failed)
        if leaving or task is None or task.state not in ("executing", "resumed"):
            pool.abandon(future)
            break
    return _result(future)


def _result(future: Future[bytes]) -> bytes:
    try:
        return future.result()
    except WorkerDiedError as error:
        return pickle.dumps((False, error))
