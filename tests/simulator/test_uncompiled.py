"""Kernels without a compiler: the same bits, and no longer than compiling would take."""

import ast
import contextlib
import itertools
import math
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from simulator import uncompiled
from simulator.compiled import compiled
from tests.simulator.kernel_files import DECORATORS, KERNELS

Array = NDArray[np.float64]


class Pair(NamedTuple):
    first: float
    second: float | None


@compiled
def divided(x: float, y: float) -> float:
    return x / y


@compiled
def functions(x: float, y: float, out: Array) -> Pair:
    """Everything of `math` that kernels use, and what Python and the C library do differently."""
    out[0] = divided(1.0, x) + 0.5 / math.sqrt(abs(y) - 1.0)
    out[1] = math.exp(x) - math.expm1(y)
    out[2] = math.log(x) * math.log1p(y)
    out[3] = math.hypot(x, y) + math.atan2(x, y) + math.atan(x)
    out[4] = math.sin(x) * math.cos(y) / math.tan(x)
    out[5] = math.asin(x) + math.acos(y)
    out[6] = math.sinh(x) / math.cosh(y)
    out[7] = math.asinh(x) + math.erfc(y)
    out[8] = min(x, y) - max(y, x)
    out[9] = math.copysign(x, y)
    out[10] = x % y if y > 0.0 else x // 2.0
    out[11] = 1.0 if math.isfinite(x) and not math.isnan(y) else math.inf
    low = 0.0
    for i in range(3):
        low += x * i / (i - 1.0)
    out[12] = low
    out[13] = math.pow(abs(x), y)
    return Pair(out[0] / out[8], None)


def bits(value: Any) -> Any:
    """Return what tells any two values apart; every nan is the same."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, [bits(entry) for entry in value.ravel().tolist()]
    if isinstance(value, tuple):
        return type(value), *map(bits, value)
    return type(value), value.hex() if isinstance(value, float) else value


def both(kernel: Any, *args: Any) -> tuple[Any, Any]:
    """Run a kernel both ways; return what they say and what they wrote."""
    copies = tuple(a.copy() if isinstance(a, np.ndarray) else a for a in args)
    answer, _ = uncompiled.run(kernel.__wrapped__, copies, math.inf)
    return bits((answer, copies)), bits((kernel(*args), args))


def test_the_same_bits_at_every_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    edges = (0.0, 1.0, 1e-320, 0.7, 3.0, 800.0, 1e308, math.inf, math.nan)
    signed = [sign * edge for edge in edges for sign in (1.0, -1.0)]
    for x, y in itertools.product(signed, signed):
        plain, machine = both(functions, x, y, np.zeros(14))
        assert plain == machine, (x, y)

    @settings(max_examples=300)
    @given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
    def anywhere(x: float, y: float) -> None:
        plain, machine = both(functions, x, y, np.zeros(14))
        assert plain == machine

    anywhere()


@compiled
def counted(out: Array, steps: int) -> float:
    for i in range(steps):
        out[0] += 1.0
        out[1] += i
    return float(out[0])


def test_what_takes_longer_than_compiling_is_compiled_and_nothing_is_done_twice() -> None:
    out = np.zeros(2)
    with pytest.raises(uncompiled.NotSoError):
        uncompiled.run(counted.__wrapped__, (out, 10**9), 0.01)  # type: ignore[attr-defined]
    assert out.tolist() == [0.0, 0.0]
    assert counted(out, 10) == 10.0
    kernel: Any = counted
    assert kernel._dispatcher is None
    assert counted(out, 10**8) == 10.0 + 10**8
    assert len(kernel.dispatcher.overloads) == 1
    assert counted(out, 10) == 20.0 + 10**8


@compiled
def looked_up(table: Array, row: int) -> float:
    return float(table[row, 1])


def test_a_large_table_is_no_reason_to_compile() -> None:
    """That of a tracker has 2,049 rows and up to 76 columns; most rows are never asked."""
    assert looked_up(np.ones((2049, 76)), 7) == 1.0
    kernel: Any = looked_up
    assert kernel._dispatcher is None


def test_what_would_take_too_long_is_given_up_after_a_few_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ticks = itertools.count()
    monkeypatch.setattr(uncompiled, "_clock", lambda: float(next(ticks)))
    with pytest.raises(uncompiled.NotSoError, match="would"):
        uncompiled.run(counted.__wrapped__, (np.zeros(2), 1000), 100.0)  # type: ignore[attr-defined]
    assert next(ticks) < 5
    answer, _ = uncompiled.run(counted.__wrapped__, (np.zeros(2), 100), 100.0)  # type: ignore[attr-defined]
    assert answer == 100.0


@compiled
def ratio(one: int, other: int) -> float:
    return one / other


@pytest.mark.parametrize("most_s", [0.0, math.inf])
def test_limit_ends_with_its_run(most_s: float) -> None:
    out = np.zeros(600)
    with contextlib.suppress(uncompiled.NotSoError):
        uncompiled.run(counted.__wrapped__, (out, 600), most_s)  # type: ignore[attr-defined]
    before = out[0]
    assert uncompiled.twin(counted)(out, 600) == before + 600.0


def test_what_python_refuses_is_compiled() -> None:
    assert math.isinf(ratio(1, 0))
    kernel: Any = ratio
    assert len(kernel.dispatcher.overloads) == 1


def test_an_estimate_of_few_frames_brings_no_compiler() -> None:
    code = """
import sys, hybridtof
sensor = hybridtof.parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-4]}})
scene = hybridtof.parse_scene({"object": {"c0": 0.08, "c1": 0.06, "c2": 0.1}})
frames = hybridtof.frames_from_columns(sensor, {"w1": [0.0002], "w2": [0.004]})
answer = hybridtof.estimate(sensor, scene, frames, ["conventional", "intensity"])
assert len(answer.results) == 2
heavy = {"numba", "scipy.linalg", "scipy.special", "scipy.stats", "scipy.constants"}
assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.stem)
def test_kernels_use_what_both_ways_know(path: Path) -> None:
    """No powers of whole numbers: machine code multiplies, the C library has a function.

    No sums of arrays: machine code adds one by one, numpy in pairs.
    """
    known = set(vars(uncompiled._MATH))
    for function in ast.parse(path.read_text()).body:
        if not isinstance(function, ast.FunctionDef):
            continue
        if not any(isinstance(d, ast.Name) and d.id in DECORATORS for d in function.decorator_list):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Pow):
                power = node.right if isinstance(node, ast.BinOp) else node.value
                whole = isinstance(power, ast.Constant) and isinstance(power.value, int)
                assert not whole, f"{path.name}:{node.lineno}"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                assert node.func.attr not in ("sum", "mean", "dot", "prod", "std", "var")
            assert not isinstance(node, ast.MatMult)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert node.value.id != "math" or node.attr in known, node.attr
