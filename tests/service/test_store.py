"""The store by itself: what it promises, on SQLite."""

import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from service.errors import BusyError, StoreError
from service.store.holder import has_ended, holder_name
from service.store.job_store import JobStore
from service.store.record import JobRecord, NewJob
from service.store.retention import Retention
from service.store.tables import METADATA
from simulator.errors import InvalidInputError


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


_opened: list[JobStore] = []


def store_at(path: Path, clock: Clock | None = None, **limits: Any) -> JobStore:
    retention = Retention(**{"jobs": 100} | limits)
    store = JobStore(f"sqlite:///{path}/jobs.sqlite", retention, 0.05, clock or Clock())
    _opened.append(store)
    return store


@pytest.fixture(autouse=True)
def every_store_is_closed() -> Iterator[None]:
    """Else whatever test runs when the garbage is collected is told of an open database."""
    yield
    while _opened:
        _opened.pop().close()


def new(name: str, **fields: Any) -> NewJob:
    return NewJob(name, b"job", "v", "emcee", 1, **fields)


def begun(store: JobStore, name: str) -> JobRecord:
    store.add(new(name))
    claimed = store.claim(holder_name())
    assert claimed is not None
    assert claimed.record.id == name
    return claimed.record


def advanced(store: JobStore, record: JobRecord, data: bytes, whole: bool) -> JobRecord | None:
    return store.advance(record, data, whole, {"phase": "sampling"}, 1.0, 2.0)


def test_turns(tmp_path: Path) -> None:
    """Round the clients, and round the jobs of each; what is to be cancelled comes first."""
    store = store_at(tmp_path)
    for name, client in (("a1", "a"), ("a2", "a"), ("a3", "a"), ("b1", "b")):
        store.add(new(name, client=client))
    holder = holder_name()

    def turn() -> str:
        claimed = store.claim(holder)
        assert claimed is not None
        assert store.waits()
        store.release(holder, claimed.record.id)
        return claimed.record.id

    order = [turn() for _ in range(8)]
    assert order == ["a1", "b1", "a2", "b1", "a3", "b1", "a1", "b1"]
    store.cancel("a1")
    assert [turn() for _ in range(2)] == ["a1", "a1"]
    while store.claim(holder):
        pass
    assert not store.waits()


def test_a_client_takes_no_room_of_others(tmp_path: Path) -> None:
    """What has ended goes where there is most; what waits is half of the room at most."""
    store = store_at(tmp_path, jobs=4)
    for name, client in (("b1", "b"), ("a1", "a"), ("a2", "a")):
        store.add(new(name, client=client))
    with pytest.raises(BusyError, match="2 posteriors of this key"):
        store.add(new("a3", client="a"))
    for name in ("b1", "a1", "a2"):
        store.cancel(name)
    for name in ("a3", "a4"):
        store.add(new(name, client="a"))
    assert [store.get(name) is None for name in ("b1", "a1", "a2")] == [False, True, False]


def test_pieces_come_back_in_order_and_a_whole_one_replaces_them(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    record: JobRecord | None = begun(store, "a")
    expected: tuple[bytes, ...] = ()
    for data, whole in ((b"1", True), (b"2", False), (b"3", False), (b"4", True), (b"5", False)):
        assert record is not None
        record = advanced(store, record, data, whole)
        expected = (data,) if whole else (*expected, data)
        kept = store_at(tmp_path).drawn("a")
        assert kept is not None
        assert kept.pieces == expected
    store.close()


def test_the_second_of_two_that_computed_a_chunk_changes_nothing(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    record = begun(store, "a")
    first = advanced(store, record, b"1", True)
    assert first is not None
    assert advanced(store, record, b"other", True) is None
    assert store.report(record, {"phase": "late"}) is None
    assert store.finish(record, "done", {}) is None
    kept = store.drawn("a")
    assert kept is not None
    assert (kept.record, kept.pieces) == (first, (b"1",))
    assert store.finish(first, "done", {"x": 1}) is not None
    assert store.finish(first, "failed", None) is None
    store.close()


def test_a_lease_runs_out_and_is_renewed(tmp_path: Path, clock: Clock) -> None:
    store = store_at(tmp_path, clock)
    record = begun(store, "a")
    me, other = holder_name(), holder_name()
    assert store.claim(other) is None
    clock.now += 100
    assert store.claim(me) is not None
    for _ in range(5):
        clock.now += 10
        store.renew(me, [record.id])
        assert store.claim(other) is None
    store.release(me)
    assert store.claim(other) is not None
    store.close()


def test_what_a_process_held_that_was_killed_is_free_at_once(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    code = "from service.store.holder import holder_name; print(holder_name()); input()"
    with subprocess.Popen(
        (sys.executable, "-c", code), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        name = process.stdout.readline().strip()
        store.add(new("a"))
        assert store.claim(name) is not None
        assert not has_ended(name)
        assert store.claim(holder_name()) is None
        process.kill()
        process.wait()
    assert has_ended(name) == (sys.platform == "linux")
    assert (store.claim(holder_name()) is not None) == (sys.platform == "linux")
    store.close()


def test_retention_by_age_count_and_bytes(tmp_path: Path, clock: Clock) -> None:
    store = store_at(tmp_path, clock, jobs=3, draws_bytes=5, age_s=50.0)
    for name in "abc":
        record = advanced(store, begun(store, name), b"1234", True)
        assert record is not None
        store.finish(record, "done", {})
        clock.now += 20
    store.sweep()  # the draws of the newest alone have room, and "a" is too old
    assert [(r.id, store.drawn(r.id).pieces) for r in store.page("", None, 9)] == [  # type: ignore[union-attr]
        ("c", (b"1234",)),
        ("b", ()),
    ]
    store.add(new("d"))
    store.add(new("e"))  # makes room for itself
    assert [r.id for r in store.page("", None, 9)] == ["e", "d", "c"]
    store.close()


def test_pages_are_stable_and_a_client_s_own(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    for name in "abcde":
        store.add(new(name, client="me"))
        store.add(new(name + "2", client="you"))
    first = store.page("me", None, 2)
    store.add(new("f", client="me"))
    store.delete("d")
    second = store.page("me", first[-1].sequence, 2)
    assert [r.id for r in first + second] == ["e", "d", "c", "b"]
    store.close()


def test_keys_outlive_the_process_and_are_a_client_s_own(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    store.add(new("a", key="k", client="me"))
    store.close()
    store = store_at(tmp_path)
    assert store.add(new("b", key="k", client="me")).id == "a"
    assert store.add(new("c", key="k", client="you")).id == "c"
    store.close()


def test_a_disk_that_is_full_is_said_and_loses_nothing(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    record = begun(store, "a")

    def small(connection: Any, *_: Any) -> None:
        connection.execute("PRAGMA max_page_count = 20").close()

    sa.event.listen(store.engine, "checkout", small)
    with pytest.raises(StoreError, match="cannot be written now: database or disk is full"):
        advanced(store, record, bytes(10**6), True)
    with pytest.raises(StoreError, match="full"):
        store.add(NewJob("b", bytes(10**6), "v", "emcee", 1))
    assert store.get("a") == record
    sa.event.remove(store.engine, "checkout", small)
    with store.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count = 1000000")
    assert advanced(store, record, bytes(10**6), True) is not None
    store.close()


def test_a_connection_that_is_in_use_ends_with_its_use(tmp_path: Path) -> None:
    """As that of a thread that looks for work while the service ends: nobody else closes it."""
    store = store_at(tmp_path)
    with store.database.read() as connection:
        used: Any = connection.connection.dbapi_connection
        store.close()
        assert connection.exec_driver_sql("SELECT 1").scalar() == 1
    with pytest.raises(sqlite3.ProgrammingError, match="closed"):
        used.execute("SELECT 1")


def test_what_was_accepted_is_on_the_disk(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    with store.engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2  # FULL
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
    assert (tmp_path / "jobs.sqlite").stat().st_mode & 0o077 == 0
    store.close()


def test_migrations_make_the_tables_as_they_are_described(tmp_path: Path) -> None:
    store = store_at(tmp_path)
    plain = sa.create_engine("sqlite://")
    METADATA.create_all(plain)
    found = [
        {
            table: (
                [(str(c["name"]), str(c["type"]), c["nullable"]) for c in look.get_columns(table)],
                look.get_indexes(table),
                sorted(u["column_names"] for u in look.get_unique_constraints(table)),
            )
            for table in METADATA.tables
        }
        for look in (sa.inspect(plain), sa.inspect(store.engine))
    ]
    assert found[0] == found[1]
    plain.dispose()
    store.close()


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("mysql://host/name", "scheme 'mysql' is not known"),
        ("nonsense", "no address"),
        ("sqlite://", "must name a file"),
        ("sqlite:////proc/none/jobs.sqlite", "cannot be made"),
        ("postgresql://me:secret@127.0.0.1:1/none", "cannot be used"),
    ],
)
def test_refused_at_the_start(url: str, said: str) -> None:
    with pytest.raises(InvalidInputError, match=said) as caught:
        JobStore(url, Retention(1), busy_s=0.1)
    (problem,) = caught.value.problems
    assert problem.pointer == "/HYBRIDTOF_DATABASE"
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_tables_of_a_newer_version_and_files_that_are_none(tmp_path: Path) -> None:
    store_at(tmp_path).close()
    with sqlite3.connect(tmp_path / "jobs.sqlite") as file:
        file.execute("UPDATE alembic_version SET version_num = '9999'")
    file.close()
    with pytest.raises(InvalidInputError, match=r"newer hybridtof \(9999\): upgrade"):
        store_at(tmp_path)
    (tmp_path / "jobs.sqlite").write_text("this is no database, but a text of some length\n" * 99)
    with pytest.raises(InvalidInputError, match="not a database"):
        store_at(tmp_path)
