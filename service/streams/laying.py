"""Lines alike but for numbers and texts in them, written all at once.

To make an object of the text of every number takes more time than to write the number. The bytes
of many lines are therefore copied by a kernel, which holds no other thread up meanwhile.
"""

from collections.abc import Iterable, Sequence
from itertools import accumulate, chain, repeat
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["Column", "json_of", "laid"]

Column = NDArray[np.float64] | NDArray[np.int64] | list[bytes] | bytes
"""Numbers of n lines, or a text of each without a line end, or one text that all have."""

_FEW = 32  # lines that Python writes as quickly
_COMMA, _LINE_END = b",", b"\n"


def laid(fixed: Sequence[bytes], columns: Sequence[Column], n: int) -> bytes:
    """Return n lines, made of what they have in common and of their own texts between.

    Parameters
    ----------
    fixed : sequence of bytes
        The m + 1 texts that all lines have in common, the last with the line end.
    columns : sequence of Column
        What lies between these, m columns; numbers are written as JSON has them, nan as null.
    n : int
        How many lines.
    """
    between, which, own = [fixed[0]], list[int](), dict[Any, tuple[bytes, bytes]]()
    for number, (column, after) in enumerate(zip(columns, fixed[1:], strict=True)):
        if isinstance(column, bytes):
            between[-1] += column + after
            continue
        if isinstance(column, list):
            key: Any = number
            own[key] = _LINE_END, _LINE_END.join(column)
        else:
            # numbers that are the same to the bit are written once
            key = column.dtype.char, column.tobytes()
            if key not in own:
                own[key] = _COMMA, json_of(column)[1:-1]
        which.append(list(own).index(key))
        between.append(after)
    if n >= _FEW:
        return _by_kernel(between, which, list(own.values()), n)
    texts = [text.split(mark) for mark, text in own.values()]
    rows: list[Iterable[bytes]] = [repeat(between[0], n)]
    for place, after in zip(which, between[1:], strict=True):
        rows += [texts[place], repeat(after, n)]
    return b"".join(chain.from_iterable(zip(*rows, strict=True)))


def json_of(numbers: NDArray[Any]) -> bytes:
    """Return numbers as a JSON list."""
    # what was kept begins at any byte, and orjson reads whole numbers
    numbers = np.require(numbers, requirements=["C", "A"])
    return orjson.dumps(numbers, option=orjson.OPT_SERIALIZE_NUMPY)


def _by_kernel(
    between: Sequence[bytes], which: Sequence[int], own: Sequence[tuple[bytes, bytes]], n: int
) -> bytes:
    """Return what `laid` does, of texts each of which ends with a mark."""
    text = b"".join(text + mark for mark, text in own)
    lengths = [len(text) + 1 for _, text in own]
    size = n * sum(map(len, between)) + sum(lengths[place] - n for place in which)
    out = np.empty(size, dtype=np.uint8)
    _lay(
        np.frombuffer(text, dtype=np.uint8),
        np.frombuffer(b"".join(mark for mark, _ in own), dtype=np.uint8),
        np.array([0, *accumulate(lengths)], dtype=np.uint64),
        np.array(which, dtype=np.int64),
        np.frombuffer(b"".join(between), dtype=np.uint8),
        np.array([0, *accumulate(map(len, between))], dtype=np.uint64),
        out,
        n,
    )
    return out.tobytes()


@compiled
def _lay(
    text: NDArray[np.uint8],
    marks: NDArray[np.uint8],
    here: NDArray[np.uint64],
    which: NDArray[np.int64],
    fixed: NDArray[np.uint8],
    parts: NDArray[np.uint64],
    out: NDArray[np.uint8],
    n: int,
) -> None:
    """Write n lines.

    Parameters
    ----------
    text : ndarray of uint8
        The texts of k columns, one column after another.
    marks : ndarray of uint8, shape (k,)
        What each text of a column ends with.
    here : ndarray of uint64, shape (k + 1,)
        Where the texts of each column begin; changed.
    which : ndarray of int64, shape (m,)
        Whose text comes next, along a line.
    fixed : ndarray of uint8
        What all lines have in common.
    parts : ndarray of uint64, shape (m + 2,)
        Where each of its m + 1 parts begins, and where the last ends.
    out : ndarray of uint8
        Room for all lines.
    n : int
        How many lines.
    """
    # places without a sign: of one with a sign a kernel asks whether it counts from the end
    one, to = np.uint64(1), np.uint64(0)
    after = here.copy()
    for _ in range(n):
        for part in range(len(which) + 1):
            at = parts[part]
            while at < parts[part + 1]:
                out[to] = fixed[at]
                to += one
                at += one
            if part < len(which):
                at, mark = here[which[part]], marks[which[part]]
                while text[at] != mark:
                    out[to] = text[at]
                    to += one
                    at += one
                after[which[part]] = at + one
        here[:] = after
