"""One process at a time makes the machine code of a kernel for a kind of call; others wait for it.

Two processes that begin together on an empty cache need the same kernels at the same time. A range
of bytes of one file in the cache's folder stands for each: the operating system frees it when its
holder ends, however it ends, and nothing is left behind but an empty file.
"""

import contextlib
import functools
import hashlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

__all__ = ["NAME", "turn"]

NAME = "compiling.lock"
# who has waited for so long compiles itself: less than a worker may stand still; and how long
# between looks, each of which takes processor time enough to be seen not to stand still [s]
_MOST_S, _PAUSE_S = 5.0, 0.01
_sleep = time.sleep


@functools.cache
def _opened(folder: Path) -> int | None:
    """Return the open file, which stays open: closing it would free all that the process holds."""
    with contextlib.suppress(OSError):
        return os.open(folder / NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    return None


@contextlib.contextmanager
def turn(folder: Path, name: str) -> Iterator[None]:
    """Hold the lock of what is compiled, or do without where it cannot be had in time.

    Parameters
    ----------
    folder : Path
        Of the cache, which can be written to.
    name : str
        What is compiled: the kernel and the types of its arguments.
    """
    file = _opened(folder)
    if file is None or sys.platform == "win32":
        yield
        return
    import fcntl

    start = int.from_bytes(hashlib.sha256(name.encode()).digest()[:6])
    until = time.monotonic() + _MOST_S
    held = False
    while not held:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, start)
            held = True
        except (BlockingIOError, PermissionError):
            if time.monotonic() > until:
                break
            _sleep(_PAUSE_S)
        except OSError:  # a file system without locks
            break
    try:
        yield
    finally:
        if held:
            fcntl.lockf(file, fcntl.LOCK_UN, 1, start)
