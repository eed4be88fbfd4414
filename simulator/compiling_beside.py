"""Machine code that is loaded or made in a thread of its own, while the interpreter answers.

One thread does it all: numba compiles one kernel at a time in any case.
"""

import queue
import threading
from typing import Any

__all__ = ["Making", "begun"]


class Making:
    """Machine code of one kernel for one kind of call.

    Attributes
    ----------
    done : threading.Event
        Set as soon as it is there; also where it cannot be made, which the next call is told.
    slow : bool
        Whether it was waited for in vain: it is being made, and not just loaded.
    """

    def __init__(self) -> None:
        self.done = threading.Event()
        self.slow = False


_begun: dict[tuple[Any, Any], Making] = {}
_ahead: queue.SimpleQueue[tuple[Making, Any, tuple[Any, ...]]] = queue.SimpleQueue()
_lock = threading.Lock()
_threads: list[threading.Thread] = []


def begun(kernel: Any, args: tuple[Any, ...], kind: Any) -> Making:
    """Return the making of machine code for such calls, which begins now if it has not.

    Parameters
    ----------
    kernel : Kernel
        Of `simulator.compiled`.
    args : tuple
        Of a call; their types count.
    kind : object
        Of them (`simulator.uncompiled.kind_of`).
    """
    with _lock:
        making = _begun.get((kernel, kind))
        if making is None:
            making = _begun[kernel, kind] = Making()
            _ahead.put((making, kernel, args))
            if not _threads:
                _threads.append(threading.Thread(target=_work, name="compiling", daemon=True))
                _threads[0].start()
    return making


def _work() -> None:
    while True:
        making, kernel, args = _ahead.get()
        try:
            kernel.make(args)
        except Exception:  # noqa: S110  # who calls the kernel next is told
            pass
        finally:
            making.done.set()
        del making, kernel, args  # arrays, maybe large ones
