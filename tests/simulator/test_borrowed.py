"""Kernels count references only where they make or return arrays, and lose none."""

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core import runtime

from simulator import borrowed

# numba's classes carry no types, and its stubs know a part of its options
_njit: Any = numba.njit
_numbas: Any = runtime
_runtime, _counting = _numbas.rtsys, _numbas._nrt_python
_Lowering: Any = borrowed._Lowering
ORDER = np.array([2, 0])


class Both(NamedTuple):
    first: Any
    second: Any


def looks(a: Any, b: Any) -> Any:
    both = Both(a, b)
    row = both.first[1]
    row.flat[0] = both.second[0]
    total = 0.0
    for i in range(row.size):
        total += row[i] * a[0, :][i]
    return total


def cuts(a: Any, b: Any) -> Any:  # noqa: ARG001
    return a[1]


def hands_on(a: Any, b: Any) -> Any:
    return Both(a[0], b)


def makes(a: Any, b: Any) -> Any:
    work = np.empty(b.size)
    for i in range(b.size):
        work[i] = a[0, i] * b[i]
    return work[0]


def copies(a: Any, b: Any) -> Any:
    return a[0][ORDER][0] * b[0]


def adds(a: Any, b: Any) -> Any:
    return (a[0] + b)[0]


@pytest.mark.parametrize(
    ("function", "borrows"),
    [
        (looks, True),
        (cuts, False),
        (hands_on, False),
        (makes, False),
        (copies, False),
        (adds, False),
    ],
)
def test_references_are_counted_where_an_array_is_made_or_returned(
    monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], borrows: bool
) -> None:
    told: list[tuple[str, bool]] = []
    asked = _Lowering._borrows

    def borrowing(self: Any) -> bool:
        told.append((self.func_ir.func_id.func_name, asked(self)))
        return told[-1][1]

    monkeypatch.setattr(_Lowering, "_borrows", borrowing)
    compiled = _njit(pipeline_class=borrowed.Compiler)(function)
    _counting.memsys_enable_stats()
    a, b = np.arange(1.0, 7.0).reshape(2, 3), np.array([2.0, -1.0, 3.0])
    compiled(a, b)
    assert dict(told)[function.__name__] is borrows
    held, before = (sys.getrefcount(a), sys.getrefcount(b)), _runtime.get_allocation_stats()
    for _ in range(5):
        assert np.array_equal(compiled(a, b), function(a, b))
    after = _runtime.get_allocation_stats()
    assert (sys.getrefcount(a), sys.getrefcount(b)) == held
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free
