"""Tables of long studies survive interruption: nothing lost, nothing done twice."""

import csv
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from benchmarks.resumable import Row, code_version, resume, rows_of

COLUMNS = ("set", "value", "reason")


def work(number: int) -> Row:
    return {"value": number**2 / 7, "reason": f'said "no", twice\nin set {number}'}


class Interruption(BaseException):
    """Stands for a signal, which is no Exception either."""


def interrupted_at(last: int) -> Callable[[int], Row]:
    def until(number: int) -> Row:
        if number == last:
            raise Interruption
        return work(number)

    return until


def test_an_interrupted_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.csv", tmp_path / "parts.csv"
    assert resume(whole, COLUMNS, range(10), work) == 10
    with pytest.raises(Interruption):
        resume(parts, COLUMNS, range(10), interrupted_at(6))
    assert len(rows_of(parts)) == 6
    assert resume(parts, COLUMNS, range(10), work) == 4
    assert parts.read_bytes() == whole.read_bytes()
    assert resume(parts, COLUMNS, range(10), work) == 0


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_line_cut_short_is_done_again(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "table.csv"
    resume(path, COLUMNS, range(5), work)
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    rows = rows_of(path)
    assert rows == list(csv.DictReader(whole.decode().splitlines()))[: len(rows)]
    resume(path, COLUMNS, range(5), work)
    assert path.read_bytes() == whole


def test_side_by_side_the_same_sets_are_done_once(tmp_path: Path) -> None:
    alone, together = tmp_path / "alone.csv", tmp_path / "together.csv"
    resume(alone, COLUMNS, range(40), work)
    with ThreadPoolExecutor(4) as executor:
        resume(together, COLUMNS, range(25), work, executor)
        resume(together, COLUMNS, range(40), work, executor)
    order = sorted(rows_of(together), key=lambda row: int(row["set"]))
    assert order == rows_of(alone)


def test_a_table_of_other_columns_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    resume(path, COLUMNS, range(2), work)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="other columns"):
        resume(path, ("set", "value"), range(3), work)
    with pytest.raises(ValueError, match="no columns"):
        resume(path, COLUMNS, range(3), lambda _: {"colour": "red"})
    assert path.read_bytes() == before


def test_two_writers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"

    def meddle(number: int) -> Row:
        with pytest.raises(RuntimeError, match="another process"):
            resume(path, COLUMNS, range(3), work)
        return work(number)

    assert resume(path, COLUMNS, range(3), meddle) == 3
    assert len(rows_of(path)) == 3


def test_the_version_is_known_where_there_is_a_repository() -> None:
    assert code_version()
