"""Names of processes that hold jobs, and which of them are known to have ended.

A lease runs out by itself. A process that was killed on this machine need not be waited for.
"""

import os
import sys
import uuid
from pathlib import Path

from service.process_watch import status_fields

__all__ = ["has_ended", "holder_name"]


def _machine() -> str | None:
    """Name the processes' numbers that this process sees: of one boot, and one container."""
    if sys.platform != "linux":
        return None
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot}.{Path('/proc/self/ns/pid').stat().st_ino}"
    except OSError:
        return None


def _started(pid: int) -> str | None:
    """Return when a process started, in ticks since the boot; None where there is none."""
    fields = status_fields(pid)
    return None if fields is None or fields[0] in "ZX" else fields[19]


def holder_name() -> str:
    """Return a name that tells this process from every other, and every call from the others."""
    machine = _machine() or "elsewhere"
    return f"{machine} {os.getpid()} {_started(os.getpid())} {uuid.uuid4().hex[:8]}"


def has_ended(holder: str) -> bool:
    """Tell whether the process of that name is known to have ended; one elsewhere never is."""
    machine, pid, started, _ = holder.split(" ")
    return machine == _machine() and _started(int(pid)) != started
