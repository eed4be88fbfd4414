"""Transactions of a database, and what is said where it does not answer."""

import contextlib
import threading
from collections.abc import Iterator

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.pool import ConnectionPoolEntry

from service.errors import StoreError
from service.store.database import brief, engine_of, is_sqlite, ready

__all__ = ["Transactions"]


class Transactions:
    """A database that several stores of a process share.

    Parameters
    ----------
    url : str
        SQLAlchemy's address of an SQLite file or a PostgreSQL database.
    busy_s : float
        How long to wait for others that write, before saying that the store is locked [s].

    Raises
    ------
    InvalidInputError
        Where the database cannot be used.
    """

    def __init__(self, url: str, busy_s: float = 5.0) -> None:
        self.engine = engine_of(url, busy_s)
        ready(self.engine)
        self._writing = self.engine.execution_options(writes=True)
        # writers of one process queue here: SQLite would let them poll
        self._lock = threading.Lock() if is_sqlite(self.engine) else contextlib.nullcontext()
        self.insert = sqlite.insert if is_sqlite(self.engine) else postgresql.insert

    @contextlib.contextmanager
    def read(self) -> Iterator[sa.Connection]:
        """Begin a transaction that changes nothing.

        Raises
        ------
        StoreError
            Where the database does not answer.
        """
        with self._saying("read"), self.engine.begin() as connection:
            yield connection

    @contextlib.contextmanager
    def write(self) -> Iterator[sa.Connection]:
        """Begin a transaction that is durable at its end.

        Raises
        ------
        StoreError
            Where the database is locked, full or away.
        """
        with self._saying("written"), self._lock, self._writing.begin() as connection:
            yield connection

    @contextlib.contextmanager
    def _saying(self, deed: str) -> Iterator[None]:
        try:
            yield
        except SQLAlchemyError as error:
            message = f"the store of jobs cannot be {deed} now: {brief(error)}"
            raise StoreError(message) from error

    def close(self) -> None:
        """End connections: those that a thread still uses when it gives them back."""
        sa.event.listen(self.engine, "checkin", _end)
        self.engine.dispose()


def _end(_: object, entry: ConnectionPoolEntry) -> None:
    entry.close()
