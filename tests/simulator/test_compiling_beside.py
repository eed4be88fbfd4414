"""Who has others waiting goes on without a compiler while machine code is made beside."""

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import simulator.compiled
from simulator import compiling_beside, compiling_cost
from simulator.compiled import Kernel, while_compiling

Array = NDArray[np.float64]


def summed(out: Array, steps: int) -> float:
    for i in range(steps):
        out[0] += i
    return float(out[0])


def refused(x: float) -> float:
    return float(np.fromiter(iter([x]), float)[0])  # the interpreter knows more than the compiler


class Blocked:
    """Makes machine code when it is let."""

    def __init__(self, kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked, self.free, make = 0, threading.Event(), kernel.make

        def blocked(args: tuple[Any, ...]) -> None:
            self.asked += 1
            assert self.free.wait(60.0)
            make(args)

        monkeypatch.setattr(kernel, "make", blocked)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    """One for which the interpreter's time is over, and whose machine code would take a while."""
    made = Kernel(summed, for_both=False)  # type: ignore[arg-type]
    monkeypatch.setattr(made, "_folder", None)
    monkeypatch.setattr(compiling_cost, "make_s", lambda *_: 10.0)
    with while_compiling():
        assert made(np.zeros(1), 4) == 6.0
    (kind,) = made._spent_s
    made._spent_s[kind] = 11.0
    return made


@pytest.fixture
def blocked(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> Iterator[Blocked]:
    found = Blocked(kernel, monkeypatch)
    yield found
    found.free.set()


def making_of(kernel: Kernel) -> compiling_beside.Making:
    (making,) = (one for (of, _), one in compiling_beside._begun.items() if of is kernel)
    return making


def test_calls_are_answered_while_machine_code_is_made(kernel: Kernel, blocked: Blocked) -> None:
    with while_compiling():
        assert [kernel(np.zeros(1), steps) for steps in (3, 4, 5)] == [3.0, 6.0, 10.0]
    assert kernel._dispatcher is None
    blocked.free.set()
    assert making_of(kernel).done.wait(60.0)
    assert len(kernel.dispatcher.overloads) == blocked.asked == 1
    assert kernel(np.zeros(1), 4) == 6.0


def test_what_takes_longer_than_compiling_waits_for_it(kernel: Kernel) -> None:
    out = np.zeros(1)
    with while_compiling():
        # minutes by the interpreter
        assert kernel(out, 10**9) == out[0] > 4e17
    assert len(kernel.dispatcher.overloads) == 1


def test_machine_code_on_the_disk_is_waited_for_a_moment_alone(
    kernel: Kernel, blocked: Blocked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is kept there may be that of other calls: then this is made, and not just loaded."""
    for name, value in (("_START_S", 0.0), ("_LOAD_S", 0.0), ("_WAIT_S", 0.01)):
        monkeypatch.setattr(simulator.compiled, name, value)
    monkeypatch.setattr(kernel, "_kept", lambda: True)
    with while_compiling():
        assert kernel(np.zeros(1), 4) == 6.0
        assert making_of(kernel).slow
        assert kernel(np.zeros(1), 4) == 6.0
    assert (blocked.asked, kernel._dispatcher) == (1, None)


def test_who_calls_what_cannot_be_compiled_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = Kernel(refused, for_both=False)  # type: ignore[arg-type]
    monkeypatch.setattr(kernel, "_folder", None)
    monkeypatch.setattr(compiling_cost, "make_s", lambda *_: 10.0)
    with while_compiling():
        assert kernel(0.5) == 0.5
        (kind,) = kernel._spent_s
        kernel._spent_s[kind] = 11.0
        kernel(0.5)
        assert making_of(kernel).done.wait(60.0)
        with pytest.raises(Exception, match="fromiter"):
            kernel(0.5)
