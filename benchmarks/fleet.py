"""Services in processes of their own, which share a store and may be killed."""

import contextlib
import dataclasses
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import httpx

from benchmarks.cluster import children, command_of

__all__ = ["SERVE", "Fleet", "Service", "fleet"]

SERVE = (sys.executable, "-m", "service.cli", "serve", "--port", "0")


class Service:
    """A service in a process of its own, on a port that the system picks.

    Attributes
    ----------
    address : str
        Where it listens, for as long as it is ``alive``: the port of one that was killed may be
        another service's a moment later, which knows nothing of what the first one kept.
    alive : bool
        Whether it was not killed yet.
    """

    alive = True

    def __init__(self, command: Sequence[str], settings: Mapping[str, str]) -> None:
        kept = {k: v for k, v in os.environ.items() if not k.startswith("HYBRIDTOF_")}
        kept["HYBRIDTOF_WARM"] = "off"
        here = {"PYTHONPATH": str(Path(__file__).parents[1])}
        self.process = subprocess.Popen(  # noqa: S603
            command, stderr=subprocess.PIPE, text=True, env=kept | here | dict(settings)
        )
        assert self.process.stderr is not None
        said = []
        for line in self.process.stderr:
            said.append(line)
            if match := re.search(r"running on (http://\S+)", line):
                self.address = match[1]
                break
        else:
            raise RuntimeError("".join(said))
        # what it says later must not fill the pipe
        self._drain = subprocess.Popen(("cat",), stdin=self.process.stderr, stdout=-3)  # noqa: S607

    def workers(self) -> list[int]:
        """Return its worker processes."""
        return [pid for pid in children(self.process.pid) if "spawn_main" in command_of(pid)]

    def kill(self) -> None:
        """End it as a power cut would."""
        self.alive = False
        self.process.kill()
        self.process.wait()
        self._drain.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()


@dataclasses.dataclass
class Fleet:
    """Services that share a store.

    Attributes
    ----------
    command : sequence of str
        Starts one.
    settings : mapping
        Of each, as variables of its environment.
    services : list of Service
        Those that live.
    """

    command: Sequence[str]
    settings: Mapping[str, str]
    services: list[Service]

    def ask(self, method: str, path: str, **options: Any) -> httpx.Response:
        """Ask any of the services, until one answers."""
        while True:
            for service in self.services:
                with contextlib.suppress(httpx.TransportError):
                    address = service.address + path
                    response = httpx.request(method, address, timeout=60, **options)
                    if response.status_code != 503:
                        return response
            time.sleep(0.05)

    def kill(self, rng: random.Random) -> str:
        """Kill a service or a worker, whichever comes; a service is started anew."""
        index = rng.randrange(len(self.services))
        workers = self.services[index].workers()
        if (which := rng.randrange(len(workers) + 1)) == 0:
            return self.kill_service(index)
        return _killed(workers[which - 1])

    def kill_service(self, index: int = 0) -> str:
        """Kill a service, and start it anew."""
        self.services[index].kill()
        self.services[index] = Service(self.command, self.settings)
        return "service"

    def kill_worker(self, index: int = 0) -> str:
        """Kill a worker of a service, as soon as there is one."""
        while not (workers := self.services[index].workers()):
            time.sleep(0.02)
        return _killed(workers[-1])

    def steps(self) -> list[int]:
        """Return how far the jobs are, the newest first."""
        page = self.ask("GET", "/v1/posteriors?limit=200").json()
        return [item["progress"]["steps"] for item in page["items"]]


def _killed(worker: int) -> str:
    with contextlib.suppress(ProcessLookupError):
        os.kill(worker, signal.SIGKILL)
    return "worker"


@contextlib.contextmanager
def fleet(command: Sequence[str], settings: Mapping[str, str], services: int) -> Iterator[Fleet]:
    """Start services, and kill them at the end."""
    running = Fleet(command, settings, [])
    try:
        for _ in range(services):
            running.services.append(Service(command, settings))
        yield running
    finally:
        for service in running.services:
            service.kill()
