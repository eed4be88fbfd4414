"""A PostgreSQL of one's own, which may be crashed."""

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

__all__ = ["postgres", "restart"]


def _postgres_binaries() -> Path | None:
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    found = shutil.which("initdb") or (str(folders[-1] / "initdb") if folders else None)
    return None if found is None else Path(found).resolve().parent


def _run_postgres(home: Path, program: str, *arguments: str) -> None:
    binaries = _postgres_binaries()
    assert binaries is not None
    who: tuple[str, ...] = ()
    if os.geteuid() == 0:  # the server refuses to run as root
        shutil.chown(home, "postgres")
        who = ("setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups")
    command = (*who, str(binaries / program), "-D", str(home / "data"), *arguments)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=home)  # noqa: S603


def _control(home: Path, *arguments: str) -> None:
    """Start or stop a server, and wait for it, on a busy machine for longer than a minute."""
    _run_postgres(home, "pg_ctl", "-w", "-t", "600", *arguments)


@contextlib.contextmanager
def postgres() -> Iterator[str | None]:
    """Run a PostgreSQL of its own, reached through a socket; None where none is installed."""
    if _postgres_binaries() is None:
        yield None
        return
    home = Path(tempfile.mkdtemp(prefix="hybridtof-pg-"))
    options = f"-k {home} -c listen_addresses= -c max_connections=60"
    try:
        _run_postgres(home, "initdb", "-U", "me", "-A", "trust")
        _control(home, "-l", str(home / "log"), "-o", options, "start")
        try:
            yield f"postgresql://me@/postgres?host={home}"
        finally:
            _control(home, "-m", "immediate", "stop")
    finally:
        shutil.rmtree(home, ignore_errors=True)


def restart(address: str) -> str:
    """Crash a server that `postgres` runs, and start it anew."""
    home = Path(address.rpartition("host=")[2])
    _control(home, "-m", "immediate", "-l", str(home / "log"), "restart")
    return "database"
