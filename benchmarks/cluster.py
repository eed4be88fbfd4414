"""A Dask scheduler and its workers as processes with TLS, started anew when they end."""

import contextlib
import json
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from benchmarks.ports import own_port

__all__ = ["Cluster", "certificate", "children", "command_of", "listens"]

_LOOK_S = 0.1


def children(pid: int) -> list[int]:
    """Return the processes that another one has started, as Linux tells it."""
    found = []
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            with contextlib.suppress(OSError):
                if int((path / "stat").read_text().rsplit(")", 1)[1].split()[1]) == pid:
                    found.append(int(path.name))
    return found


def command_of(pid: int) -> str:
    """Return what a process was started with; nothing where it has gone."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


def listens(scheduler: Path) -> bool:
    """Tell whether a scheduler has written its file, to the end: then it can be reached."""
    try:
        return "address" in json.loads(scheduler.read_text())
    except (FileNotFoundError, json.JSONDecodeError):
        return False


def certificate(folder: Path) -> dict[str, str] | None:
    """Make a certificate that vouches for itself; settings of Dask, None without openssl."""
    if shutil.which("openssl") is None:
        return None
    key, made = folder / "key.pem", folder / "certificate.pem"
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2"
    names = ("-subj", "/CN=hybridtof", "-keyout", str(key), "-out", str(made))
    subprocess.run((*command.split(), *names), check=True, capture_output=True)  # noqa: S603
    tls = "DASK_DISTRIBUTED__COMM__TLS__"
    settings = {f"{tls}CA_FILE": str(made)}
    for role in ("CLIENT", "SCHEDULER", "WORKER"):
        settings |= {f"{tls}{role}__CERT": str(made), f"{tls}{role}__KEY": str(key)}
    return settings


class Cluster:
    """A scheduler and its workers, which somebody starts anew.

    Parameters
    ----------
    dask : mapping
        Dask's settings: the certificates.
    folder : Path
        For a file.
    workers : int
        How many, of one thread each.
    protocol : str
        ``tls``, or ``tcp`` without certificates.

    Attributes
    ----------
    settings : dict of str to str
        Of a service that is to use them.
    """

    def __init__(
        self, dask: Mapping[str, str], folder: Path, workers: int, protocol: str = "tls"
    ) -> None:
        here = {"PYTHONPATH": str(Path(__file__).parents[1])}
        self._environment = os.environ | here | dict(dask)
        self._ending = threading.Event()
        self._lock = threading.Lock()
        self._parts: dict[str, subprocess.Popen[bytes]] = {}
        # started anew it listens there again, where nobody else may be meanwhile
        self._address = f"{protocol}://127.0.0.1:{own_port()}"
        self._file = folder / "scheduler.json"
        self._start("scheduler")
        while not listens(self._file):
            if self._parts["scheduler"].poll() is not None:
                raise RuntimeError("the scheduler does not start")
            time.sleep(_LOOK_S)
        self.settings = dict(dask) | {"HYBRIDTOF_EXECUTOR": self._address}
        for number in range(workers):
            self._start(f"worker {number}")
        self._keeper = threading.Thread(target=self._keep, daemon=True)
        self._keeper.start()

    @classmethod
    @contextlib.contextmanager
    def running(cls, folder: Path, workers: int = 2) -> Iterator["Cluster"]:
        """Run one, with a certificate in a folder."""
        dask = certificate(folder)
        if dask is None:
            raise RuntimeError("openssl is not installed")
        cluster = cls(dask, folder, workers)
        try:
            yield cluster
        finally:
            cluster.end()

    @staticmethod
    def command(kind: str, address: str) -> tuple[str, ...]:
        """Return what starts a scheduler at an address, or a worker of it."""
        port = address.rpartition(":")[2]
        where = f"{address} --nthreads 1 --no-nanny"
        if kind == "scheduler":
            where = f"--protocol {address.partition(':')[0]} --port {port}"
        options = (*where.split(), "--no-dashboard")
        return sys.executable, "-m", f"distributed.cli.dask_{kind}", *options

    def _start(self, name: str) -> None:
        kind = name.partition(" ")[0]
        command = self.command(kind, self._address)
        if kind == "scheduler":
            command = (*command, "--host", "127.0.0.1", "--scheduler-file", str(self._file))
        self._parts[name] = subprocess.Popen(  # noqa: S603
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=self._environment,
        )

    def _keep(self) -> None:
        """Start anew what has ended: of a lost scheduler workers end by themselves."""
        while not self._ending.wait(_LOOK_S):
            with self._lock:
                for name, part in tuple(self._parts.items()):
                    if part.poll() is not None:
                        self._start(name)

    def pids(self) -> dict[str, int]:
        """Return the processes that are there by name: scheduler, workers, and those of chunks."""
        with self._lock:
            found = {name: part.pid for name, part in self._parts.items()}
        for name, pid in tuple(found.items()):
            for child in children(pid):
                if "spawn_main" in command_of(child):
                    found[f"process of {name}"] = child
        return found

    def kill(self, rng: random.Random, what: str = "") -> str:
        """Kill the scheduler, a worker, or the process in which a worker computes a chunk.

        Parameters
        ----------
        rng : random.Random
            Says what is killed.
        what : str
            With what its name must begin.
        """
        found = self.pids()
        name = rng.choice(sorted(name for name in found if name.startswith(what)))
        with contextlib.suppress(ProcessLookupError):
            os.kill(found[name], 9)
        return name.rstrip(" 0123456789")

    def end(self) -> None:
        """Kill them all."""
        self._ending.set()
        self._keeper.join()
        for part in self._parts.values():
            part.kill()
        for part in self._parts.values():
            part.wait()
