"""What can be told of a process from outside: its processor time, and why it ended."""

import os
import signal
import sys
from pathlib import Path

__all__ = ["ended_by_itself", "processor_time", "status_fields"]

# what a process does to itself; any other signal is somebody else's doing
_OWN = frozenset(
    int(getattr(signal, name))
    for name in ("SIGABRT", "SIGBUS", "SIGFPE", "SIGILL", "SIGSEGV", "SIGSYS", "SIGTRAP")
    if hasattr(signal, name)
)


def status_fields(pid: int) -> list[str] | None:
    """Return the fields of /proc/PID/stat from the third on, its state; None where there are none.

    Parameters
    ----------
    pid : int
        Of a process of this machine.
    """
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except (OSError, IndexError):
        return None


def processor_time(pid: int) -> float | None:
    """Return the processor time that a process has taken [s]; None where that cannot be told.

    Parameters
    ----------
    pid : int
        Of a process that has not been waited for.
    """
    if sys.platform != "linux" or (fields := status_fields(pid)) is None:
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def ended_by_itself(exit_code: int | None) -> bool:
    """Tell whether a process ended by what it computed, not by a signal that it was sent.

    Parameters
    ----------
    exit_code : int or None
        As of `multiprocessing.Process`: negative for a signal.
    """
    return exit_code is not None and (exit_code >= 0 or -exit_code in _OWN)
