"""Tables of long studies: one line a data set, so that an interrupted run goes on where it stopped.

A table is a CSV file that one process writes. A line is written at once and flushed to the disk
before the next data set counts as done; a line that an interruption cut short is dropped at the
next start, and its data set, whose seed depends on its number alone, is done again.
"""

import contextlib
import csv
import fcntl
import io
import json
import multiprocessing
import os
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

__all__ = ["Row", "code_version", "objects_of", "pool", "resume", "rows_of"]

Row = Mapping[str, str | int | float]


def code_version() -> str:
    """Return the commit that runs, marked where files other than tables differ from it."""
    root = Path(__file__).parents[1]
    differs = ["git", "diff", "--name-only", "HEAD", "--", ".", ":(exclude)*.csv"]
    try:
        found = subprocess.run(
            ["git", "rev-parse", "--short=10", "HEAD"],  # noqa: S607
            cwd=root,
            capture_output=True,
            text=True,
            check=True,
        )
        changed = subprocess.run(  # noqa: S603 (a fixed command)
            differs, cwd=root, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return found.stdout.strip() + ("-dirty" if changed.stdout.strip() else "")


@contextlib.contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """Give so many processes, or None where one does: this one."""
    if workers == 1:
        yield None
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        yield executor


def rows_of(path: Path) -> list[dict[str, str]]:
    """Read the complete lines of a table; none where there is no file."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1])))


def objects_of(path: Path) -> list[dict[str, Any]]:
    """Read the complete lines of a file of JSON lines, and drop from it one that was cut short."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    path.write_text(whole, encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]


def _line(values: Sequence[object]) -> bytes:
    text = io.StringIO()
    plain = [f"{v:.7g}" if isinstance(v, float) else " ".join(str(v).split()) for v in values]
    csv.writer(text, lineterminator="\n").writerow(plain)
    return text.getvalue().encode()


@contextlib.contextmanager
def _appending(path: Path, columns: Sequence[str]) -> Iterator[Callable[[Row], None]]:
    """Lock a table and yield a function that appends a row; refuse one of other columns."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b", buffering=0) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RuntimeError(f"{path} is being written by another process") from None
        file.seek(0)
        content = file.read()
        file.truncate(content.rfind(b"\n") + 1)
        header = _line(columns)
        if b"\n" not in content:
            file.write(header)
        elif not content.startswith(header):
            raise ValueError(f"{path} has other columns than {list(columns)}: move it away")

        def append(row: Row) -> None:
            if row.keys() - set(columns):
                raise ValueError(f"{path} has no columns {sorted(row.keys() - set(columns))}")
            file.write(_line([row.get(column, "") for column in columns]))
            os.fsync(file.fileno())

        yield append


def resume(
    path: Path,
    columns: Sequence[str],
    sets: Sequence[int],
    work: Callable[[int], Row],
    executor: Executor | None = None,
) -> int:
    """Do the data sets that a table lacks, and append a line for each as soon as it is done.

    Parameters
    ----------
    path : Path
        The table.
    columns : sequence of str
        Its columns; "set" holds the number of a data set.
    sets : sequence of int
        Data sets wanted.
    work : callable
        Number of a data set to its row; picklable where there is an executor.
    executor : concurrent.futures.Executor, optional
        Runs data sets side by side.

    Returns
    -------
    int
        How many were done now.

    Raises
    ------
    ValueError
        Where the table has other columns.
    RuntimeError
        Where another process is writing it.
    """
    with _appending(path, columns) as append:
        done = {int(row["set"]) for row in rows_of(path)}
        left = [number for number in sets if number not in done]
        if executor is None:
            for number in left:
                append({"set": number, **work(number)})
            return len(left)
        futures = {executor.submit(work, number): number for number in left}
        try:
            for future in as_completed(futures):
                append({"set": futures[future], **future.result()})
        finally:
            for future in futures:
                future.cancel()
    return len(left)
