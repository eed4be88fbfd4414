"""What runs in a worker process: task after task, until its pipe closes.

A task that is a generator tells the parts of its answer one by one, so that what was told by then
is there where it does not come to its end.

Nothing heavy is imported here, so that the process is there at once; a task brings its own imports
when it is unpickled.
"""

import pickle
import signal
from collections.abc import Callable, Generator
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from service.parent_death import end_with_parent
from simulator.processor_time import watch_compiling

__all__ = ["COMPILING", "PART", "THREAD_VARIABLES", "run", "work"]

T = TypeVar("T")

COMPILING = "compiling"
"""Marks a message that says whether machine code is being made."""

PART = "part"
"""Marks a message with a part of an answer; what has neither mark is an answer."""

# numerical libraries read these when they are imported: one thread a process
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def work(pipe: "Connection[object, object]") -> None:
    """Run tasks from a pipe and send back ``(True, result)`` or ``(False, exception)``.

    Before it there are any number of ``(COMPILING, True or False)``, the first when the task
    begins, and of ``(PART, what the task yields)`` where it is a generator, whose result is what it
    returns.

    Parameters
    ----------
    pipe : Connection
        Delivers ``(function, arguments)``; its end ends the process.

    Notes
    -----
    When the parent dies the process ends at once, in the middle of a task.
    """
    end_with_parent()
    # the parent decides when a worker ends: a Ctrl-C or a SIGTERM to the group is not for us
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        except Exception as error:
            answer: tuple[bool, object] = (False, _portable(error))
        else:
            pipe.send((COMPILING, False))  # what it needs is imported, and its own time begins
            watch_compiling(lambda going: pipe.send((COMPILING, going)))
            answer = run(task, lambda part: pipe.send((PART, part)))
        try:
            pipe.send(answer)
        except (BrokenPipeError, ConnectionError):
            return
        except Exception as error:
            pipe.send((False, _portable(error)))


def run(task: Any, tell: Callable[[object], None] | None = None) -> tuple[bool, object]:
    """Run a function with its arguments; tell whether it succeeded, and with what.

    Parameters
    ----------
    task : tuple
        The function and its arguments.
    tell : callable, optional
        Gets each part where the function is a generator; needed for such.
    """
    function, arguments = task
    try:
        result = function(*arguments)
        if tell is None or not isinstance(result, Generator):
            return True, result
        while True:
            try:
                part = next(result)
            except StopIteration as end:
                return True, end.value
            tell(part)
    except Exception as error:
        return False, _portable(error)


def _portable(error: Exception) -> Exception:
    """Return an exception that survives the pipe: not each can be made anew from its arguments."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 (made one line above)
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
