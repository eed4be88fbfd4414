"""Ports for what has to be told its own."""

import random
import socket
from pathlib import Path

__all__ = ["own_port"]

_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_LOWEST = 10_000
# where those begin that systems give to who asks for any, if they do not say
_GIVEN = 32_768


def own_port() -> int:
    """Return a free port that the system gives to nobody who asks for any.

    One that it gave may be another's as soon as it is free, be it to be taken again at once.
    """
    given = int(_RANGE.read_text().split()[0]) if _RANGE.exists() else _GIVEN
    ports = range(_LOWEST, max(given, _LOWEST + 1_000))
    for port in random.SystemRandom().sample(ports, len(ports)):
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
    raise RuntimeError("no port is free")
