"""From the address of a database to one that is ready: of a known kind, with today's tables."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import platformdirs
import sqlalchemy as sa
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from service.service_settings import PREFIX
from simulator.errors import InvalidInputError

__all__ = ["brief", "default_url", "engine_of", "is_sqlite", "ready"]

_POINTER = f"/{PREFIX}DATABASE"
_MIGRATION_LOCK = 5_707_331  # any number that nobody else takes an advisory lock of


def default_url() -> str:
    """Return the address of an SQLite file in the user's state folder."""
    folder = platformdirs.user_state_path("hybridtof", appauthor=False)
    return sa.URL.create("sqlite", database=str(folder / "jobs.sqlite")).render_as_string()


def is_sqlite(engine: sa.Engine) -> bool:
    """Tell whether a database is a file."""
    return engine.dialect.name == "sqlite"


def brief(error: Exception) -> str:
    """Return the first line of what a database driver says: no statements, no values."""
    cause = getattr(error, "orig", None) or error
    return str(cause).strip().splitlines()[0] if str(cause).strip() else type(cause).__name__


def _checked(text: str) -> sa.URL:
    try:
        url = sa.make_url(text)
    except ArgumentError:
        raise InvalidInputError.at(
            _POINTER,
            "is no address of a database: write sqlite:////srv/jobs.sqlite (sqlite:/// and the "
            "path of the file) or postgresql://...",
        ) from None
    kind = url.get_backend_name()
    if kind == "sqlite":
        if url.database in (None, "", ":memory:") or "mode" in url.query:
            raise InvalidInputError.at(_POINTER, "must name a file: jobs outlive the service")
        return url.set(drivername="sqlite")
    if kind == "postgresql":
        return url.set(drivername="postgresql+psycopg")
    raise InvalidInputError.at(
        _POINTER, f"the scheme {kind!r} is not known: sqlite and postgresql are"
    )


def engine_of(text: str, busy_s: float) -> sa.Engine:
    """Return connections to a database, none of them made yet.

    Parameters
    ----------
    text : str
        Its address.
    busy_s : float
        How long to wait for another process that writes [s].

    Returns
    -------
    sqlalchemy.Engine
        Of SQLite a transaction is on the disk when it is committed, and one with the option
        ``writes`` waits for others that write before it begins.

    Raises
    ------
    InvalidInputError
        Where the address cannot be used.
    """
    url = _checked(text)
    if url.get_backend_name() == "sqlite":
        _make_file(Path(str(url.database)))
        engine = sa.create_engine(url, connect_args={"timeout": busy_s})
        sa.event.listen(engine, "connect", _on_connect)
        sa.event.listen(engine, "begin", _on_begin)
        return engine
    try:
        return sa.create_engine(
            url, pool_pre_ping=True, connect_args={"connect_timeout": max(2, round(busy_s))}
        )
    except ModuleNotFoundError:
        raise InvalidInputError.at(
            _POINTER, "PostgreSQL needs psycopg: install hybridtof[postgres]"
        ) from None


def _make_file(path: Path) -> None:
    """Make a file that nobody else reads, and the folders above it."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.touch(mode=0o600)
    except OSError as error:
        message = f"{path} cannot be made: {error.strerror}"
        raise InvalidInputError.at(_POINTER, message) from None


def _on_connect(connection: Any, _: object) -> None:
    connection.isolation_level = None  # transactions begin where `_on_begin` says, not by a guess
    try:
        # FULL: what was committed is there after a power cut; in WAL mode the default is less
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"):
            connection.execute(f"PRAGMA {pragma}").close()
    except sqlite3.Error:  # of a file that is no database; nobody else closes it then
        connection.close()
        raise


def _on_begin(connection: sa.Connection) -> None:
    writes = connection.get_execution_options().get("writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def ready(engine: sa.Engine) -> None:
    """Bring a database's tables up to date.

    Parameters
    ----------
    engine : sqlalchemy.Engine
        From `engine_of`.

    Raises
    ------
    InvalidInputError
        Where the database does not answer, or has tables of a newer version.
    """
    # not asked by workers, and as much to import as all of the store
    from alembic import command
    from alembic.config import Config
    from alembic.runtime.migration import MigrationContext
    from alembic.script import ScriptDirectory

    config = Config()
    folder = str(Path(__file__).parent / "migrations")
    config.set_main_option("script_location", folder.replace("%", "%%"))
    known = ScriptDirectory.from_config(config)
    try:
        with _alone(engine) as connection:
            present = MigrationContext.configure(connection).get_current_heads()
            unknown = set(present) - {script.revision for script in known.walk_revisions()}
            if unknown:
                raise InvalidInputError.at(
                    _POINTER,
                    f"the database has tables of a newer hybridtof ({', '.join(sorted(unknown))}): "
                    "upgrade hybridtof, or name another database",
                )
            if present != tuple(known.get_heads()):
                config.attributes["connection"] = connection
                command.upgrade(config, "head")
    except SQLAlchemyError as error:
        shown = engine.url.render_as_string(hide_password=True)
        message = f"{shown} cannot be used: {brief(error)}"
        raise InvalidInputError.at(_POINTER, message) from None
    finally:
        engine.dispose()  # connections are made where they are used


@contextlib.contextmanager
def _alone(engine: sa.Engine) -> Iterator[sa.Connection]:
    """Begin a transaction beside which no other process migrates."""
    with engine.execution_options(writes=True).begin() as connection:
        if not is_sqlite(engine):
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(_MIGRATION_LOCK)))
        yield connection
