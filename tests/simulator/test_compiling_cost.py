"""How long the interpreter may try follows from what compiling would take."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import simulator.compiled
from simulator import compiling_cost
from simulator.uncompiled import kind_of


class Inner(NamedTuple):
    x: float


class Outer(NamedTuple):
    inner: Inner
    pair: tuple[float, float]


@simulator.compiled.compiled
def squared(inner: Inner) -> float:
    return inner.x * inner.x


@simulator.compiled.compiled
def first(outer: Outer, scale: float) -> float:
    return scale * squared(outer.inner)


@simulator.compiled.compiled
def second(inner: Inner, times: int) -> float:
    return squared(inner) * times


def cost_s(kernel: Any, *args: Any) -> float:
    return compiling_cost.make_s(kernel.__wrapped__, kind_of(args))


def test_named_tuples_are_found_at_every_depth() -> None:
    kind = kind_of((Outer(Inner(1.0), (1.0, 2.0)), np.zeros(2)))
    pair = (tuple, float, float)
    assert compiling_cost._tuples(kind) == {(Inner, float), (Outer, (Inner, float), pair)}
    assert compiling_cost._tuples(kind_of((1.0, np.zeros(2), (1.0, 2)))) == set()


def test_a_kernel_costs_less_once_another_of_the_same_functions_and_tuples_is_made(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(compiling_cost, "_made", {})
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    compiling_cost.make_s.cache_clear()
    inner = Inner(3.0)
    new_s = cost_s(second, inner, 2)
    assert new_s == pytest.approx(2 * compiling_cost._NEW_S)
    assert first(Outer(inner, (1.0, 2.0)), 2.0) == 18.0
    assert cost_s(second, inner, 2) == pytest.approx(
        compiling_cost._NEW_S + compiling_cost._MADE_S  # the kernel itself is new
    )
    assert cost_s(second, Inner(3), 2) == new_s  # a whole number is another kind
