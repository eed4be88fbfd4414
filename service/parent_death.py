"""A process that ends with the one that started it: nobody waits for its answer any more."""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import wait

__all__ = ["end_with_parent", "when_closed"]

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def end_with_parent() -> None:
    """Let this process be ended as soon as its parent is.

    To be called in a process that `multiprocessing` started, before its work.

    Notes
    -----
    On Linux the kernel ends it, in the middle of whatever it computes: to be exact, when the
    thread that started it ends (prctl(2), PR_SET_PDEATHSIG), so that thread must live as long as
    the process is wanted. Elsewhere a thread waits for the parent's end; it has to wait, too, until
    compiled code gives the interpreter back.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        raise RuntimeError("this process has no parent that waits for it")
    if sys.platform == "linux":
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) failed")
        # it may have gone before the kernel was asked
        if os.getppid() != parent.pid:
            os._exit(1)
    else:
        when_closed(parent.sentinel, lambda: os._exit(1))


def when_closed(sentinel: int, call: Callable[[], None]) -> threading.Thread:
    """Call a function, in a thread of its own, when the far end of a sentinel is closed.

    Parameters
    ----------
    sentinel : int
        Handle that gets ready when a process ends (`multiprocessing.connection.wait`).
    call : callable
        What to call then, once.

    Returns
    -------
    threading.Thread
        The thread that waits; it keeps no process alive.
    """

    def watch() -> None:
        wait([sentinel])
        call()

    thread = threading.Thread(target=watch, name="parent-death", daemon=True)
    thread.start()
    return thread
