"""One way to compile a numerical kernel, and to do without where compiling takes longer.

A kernel is machine code made by numba (`simulator.machine_code`), kept in a folder of exactly its
sources (`simulator.kernel_cache`). Until there is machine code for the arguments of a call, the
interpreter answers (`simulator.uncompiled`), with the same bits, for as long in all as making or
loading that code would take: the first few frames need no compiler, and no kind of work takes much
more than twice of what it must. `KERNELS_COMPILE=soon` gives it a tenth of that time, for who has
much to ask of many kinds, as a run of all tests; `KERNELS_COMPILE=always` compiles at the first
call.
"""

import contextlib
import functools
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

from simulator.kernel_cache import CacheFolder, folder_of

__all__ = [
    "Kernel",
    "NotReadyError",
    "at_once",
    "compiled",
    "compiled_for_both",
    "compiling_at_once",
    "given_up_s",
    "hot",
    "ready_only",
    "soon",
    "when_compiling",
    "while_compiling",
]

P = ParamSpec("P")
R = TypeVar("R")

# what it takes, about, to import numba and start it, and to read from the disk what was made [s]
_START_S, _LOAD_S = 0.4, 0.04
# time between looks for machine code on the disk [s]
_LOOK_S = 0.05
# how long machine code that is on the disk is waited for at most [s]
_WAIT_S = 2.0
# share of the time of making machine code for which the interpreter may try what is called often
_HOT = 0.1
# elements beyond which it is not worth trying: less may be a table, of which few rows are asked
_MANY = 1_000_000
_WHEN = "KERNELS_COMPILE"
_lock = threading.RLock()
_waiting: list[Callable[[], None]] = []
_machine: list[Any] = []
_given_up_s = [0.0]
# what an answer of the interpreter may take where nobody can wait [s]
_QUICK_S = 0.002
_this_thread = threading.local()


class NotReadyError(Exception):
    """A kernel has no answer at once, and who asks cannot wait for one."""


@contextlib.contextmanager
def compiling_at_once() -> Iterator[None]:
    """Compile kernels at their first call, in this process and in those that it starts."""
    before = os.environ.get(_WHEN)
    os.environ[_WHEN] = "always"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_WHEN]
        else:
            os.environ[_WHEN] = before


@contextlib.contextmanager
def ready_only() -> Iterator[None]:
    """Let kernels answer in this thread only by what is there, for who must be quick.

    Raises
    ------
    NotReadyError
        By a kernel whose machine code would have to be made or loaded, but where the interpreter
        has answered such calls before, and does so in a moment.
    """
    _this_thread.ready_only = True
    try:
        yield
    finally:
        _this_thread.ready_only = False


@contextlib.contextmanager
def while_compiling() -> Iterator[None]:
    """Let the interpreter go on in this thread while machine code is made in another.

    For who answers one after the other, and is not to make them wait. What would take the
    interpreter longer than the compiler waits for machine code even so.
    """
    before = _beside()
    _this_thread.beside = True
    try:
        yield
    finally:
        _this_thread.beside = before


def _beside() -> bool:
    return getattr(_this_thread, "beside", False)


@contextlib.contextmanager
def soon(*kernels: Callable[..., Any]) -> Iterator[None]:
    """Let kernels be compiled soon in this thread, as `hot` does everywhere.

    For who calls them so often that the interpreter will not come to the end of it.
    """
    before = _soon()
    _this_thread.soon = before | set(kernels)
    try:
        yield
    finally:
        _this_thread.soon = before


def _soon() -> frozenset[Any]:
    return getattr(_this_thread, "soon", frozenset())


@contextlib.contextmanager
def at_once(*kernels: Callable[..., Any]) -> Iterator[None]:
    """Let kernels be compiled at their first call in this thread: the interpreter is not asked.

    For who knows that it would be asked in vain, as before the millions of calls of a posterior.
    """
    before = _at_once()
    _this_thread.at_once = before | set(kernels)
    try:
        yield
    finally:
        _this_thread.at_once = before


def _at_once() -> frozenset[Any]:
    return getattr(_this_thread, "at_once", frozenset())


def _in_a_hurry() -> bool:
    return getattr(_this_thread, "ready_only", False)


def when_compiling(action: Callable[[], None]) -> Callable[[], None]:
    """Have something done before the first kernel is compiled: what needs numba itself."""
    with _lock:
        if _machine:
            action()
        else:
            _waiting.append(action)
    return action


def given_up_s() -> float:
    """Return the time that calls took which the interpreter did not come to an end with [s]."""
    return _given_up_s[0]


def _compiler() -> Any:
    """Return `simulator.machine_code`; only now numba is imported."""
    with _lock:
        if not _machine:
            from simulator import machine_code

            _machine.append(machine_code)
            for action in _waiting:
                action()
            _waiting.clear()
    return _machine[0]


class Kernel:
    """A pure function of numbers, tuples and arrays, called as any function.

    Attributes
    ----------
    options : dict of str to bool
        For numba; to be set before the first call.
    patience : float
        How long the interpreter may answer, as a share of what machine code takes to make.
    """

    def __init__(self, function: FunctionType, for_both: bool) -> None:
        functools.update_wrapper(self, function)
        self.options: dict[str, bool] = {}
        self.patience = 1.0
        self._function, self._for_both = function, for_both
        self._dispatcher: Any = None
        self._below: Any = None
        self._spent_s: dict[Any, float] = {}
        # kinds of calls that the interpreter does not answer in a moment
        self._long: set[Any] = set()
        self._found, self._looked_s = False, -math.inf

    def __reduce__(self) -> str:
        return self._function.__qualname__

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Answer a call, by machine code where there is any."""
        dispatcher = self._dispatcher
        if dispatcher is not None:
            return dispatcher(*args, **kwargs)
        return self._answer(*args, **kwargs)

    @property
    def dispatcher(self) -> Any:
        """Dispatcher of numba that answers calls by Python."""
        with _lock:
            if self._dispatcher is None:
                compiler = _compiler()
                made = compiler.dispatcher(self._function, self._folder, self.options)
                if self._for_both:
                    self._answer_calls(made)
                    self._below = made
                compile_at_once = made._compile_for_args
                from simulator.uncompiled import kind_of

                def compile_now(*args: Any, **kwargs: Any) -> Any:
                    answered = compile_at_once(*args, **kwargs)
                    self._note_made(args)
                    return answered

                # asked where there is no machine code for the types of a call
                def found(*args: Any) -> Any:
                    if _in_a_hurry():
                        return self._answer_at_once
                    tried = self._may_try(args, kind_of(args))
                    return self._answer if tried else compile_now(*args)

                made._compile_for_args = found
                self._dispatcher = made
        return self._dispatcher

    @property
    def called(self) -> Any:
        """Dispatcher of numba that answers calls by kernels.

        A kernel that another kernel calls needs no way in from Python, whose opening of named
        tuples takes a sixth of the whole time of compiling, nor machine code of its own, a seventh:
        kernels call a twin without (`simulator.inner_code`).
        """
        with _lock:
            if self._for_both:
                return self.dispatcher
            if self._below is None:
                folder = self._folder
                below = folder and CacheFolder(folder.path / "inner", folder.writable)
                self._below = _compiler().dispatcher(self._function, below, self.options, True)
                self._answer_calls(self._below)
        return self._below

    @property
    def _numba_type_(self) -> Any:
        """What numba takes a kernel for that a kernel calls."""
        return self.called._numba_type_

    @functools.cached_property
    def _folder(self) -> CacheFolder | None:
        return folder_of(Path(self._function.__code__.co_filename).resolve())

    @staticmethod
    def _answer_calls(called: Any) -> None:
        """Let a number that a caller writes out be one of its type.

        As numba has it, a type of its own, a kernel is compiled anew for every 0 and 1.
        """
        template: Any = called.get_call_template
        unliteral: Any = _compiler().unliteral

        def of_types(args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
            kinds = {name: unliteral(kind) for name, kind in kws.items()}
            return template(tuple(map(unliteral, args)), kinds)

        called.get_call_template = of_types

    def make(self, args: tuple[Any, ...]) -> None:
        """Make or load machine code for the types of some arguments, without a call."""
        with at_once(self):
            self.dispatcher._compile_for_args(*args)

    def _note_made(self, args: tuple[Any, ...]) -> None:
        from simulator import compiling_cost, uncompiled

        compiling_cost.note_made(self._function, uncompiled.kind_of(args))

    def _kept(self) -> bool:
        """Tell whether there is machine code on the disk, be it since a short while."""
        now_s = time.monotonic()
        if not self._found and self._folder is not None and now_s > self._looked_s + _LOOK_S:
            name = self._function.__qualname__
            self._found = any(self._folder.path.glob(f"*.{name}-*.nbi"))
            self._looked_s = now_s
        return self._found

    def _left_s(self, kind: object) -> float:
        """Return for how long the interpreter may still try to answer such calls [s]."""
        from simulator import compiling_cost

        start_s = 0.0 if _machine else _START_S
        in_haste = self in _soon() or os.environ.get(_WHEN) == "soon"
        patience = min(self.patience, _HOT) if in_haste else self.patience
        make_s = _LOAD_S
        if not self._kept():
            make_s = patience * compiling_cost.make_s(self._function, kind)
        cost_s = start_s + make_s
        return cost_s - self._spent_s.get(kind, 0.0)

    def _may_try(self, args: tuple[Any, ...], kind: object) -> bool:
        """Tell whether the interpreter may answer a call of a kind."""
        from simulator import uncompiled

        if os.environ.get(_WHEN) == "always" or self in _at_once():
            return False
        if uncompiled.size(args) > _MANY:
            return False
        return _beside() or self._left_s(kind) > 0.0

    def _answer(self, *args: Any, **kwargs: Any) -> Any:
        """Answer a call for which there is no machine code, as far as is known."""
        from simulator import uncompiled

        if _in_a_hurry():
            return self._answer_at_once(*args, **kwargs)
        kind = uncompiled.kind_of(args)
        if kwargs or not self._may_try(args, kind):
            return self.dispatcher(*args, **kwargs)
        if _beside():
            return self._answer_beside(args, kind)
        try:
            return self._tried(args, kind, self._left_s(kind))
        except uncompiled.NotSoError:
            self._spent_s[kind] = float("inf")
            dispatcher = self.dispatcher
            return dispatcher(*args)

    def _tried(self, args: tuple[Any, ...], kind: object, most_s: float) -> Any:
        """Answer by the interpreter, if that takes no longer."""
        from simulator import uncompiled

        began = time.thread_time()
        try:
            answer, took_s = uncompiled.run(self._function, args, most_s)
        except uncompiled.NotSoError:
            _given_up_s[0] += time.thread_time() - began
            raise
        self._spent_s[kind] = self._spent_s.get(kind, 0.0) + took_s
        return answer

    def _answer_beside(self, args: tuple[Any, ...], kind: object) -> Any:
        """Answer while machine code is made, unless waiting for it takes less time."""
        from simulator import compiling_beside, compiling_cost, uncompiled

        make_s, kept = compiling_cost.make_s(self._function, kind), self._kept()
        limits = [make_s]
        making = None
        if kept or self._spent_s.get(kind, 0.0) > _HOT * make_s:
            making = compiling_beside.begun(self, args, kind)
            if making.done.is_set():
                limits = []
            elif kept and not making.slow:
                limits = [_START_S + _LOAD_S, make_s]
        for most_s in limits:
            try:
                return self._tried(args, kind, most_s)
            except uncompiled.NotSoError:
                making = making or compiling_beside.begun(self, args, kind)
                if making.done.wait(_WAIT_S):
                    break
                making.slow = True
        with at_once(self):
            dispatcher = self.dispatcher
            return dispatcher(*args)

    def _answer_at_once(self, *args: Any, **kwargs: Any) -> Any:
        """Answer as `_answer` where such calls were answered before, and nothing is in the way."""
        from simulator import uncompiled

        kind = uncompiled.kind_of(args)
        known = kind in self._spent_s and kind not in self._long
        if kwargs or not known or not uncompiled.free() or not self._may_try(args, kind):
            raise NotReadyError
        try:
            answer, took_s = uncompiled.run(self._function, args, _QUICK_S)
        except uncompiled.NotSoError:
            self._long.add(kind)
            raise NotReadyError from None
        self._spent_s[kind] += took_s
        return answer


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a pure function of numbers, tuples and arrays to machine code.

    An argument that is None is known to be None at compile time, so that ``if background is not
    None`` costs nothing: a term that a scene lacks is absent from the machine code.
    """
    return cast("Callable[P, R]", Kernel(cast("FunctionType", function), for_both=False))


def compiled_for_both(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that Python and kernels call with arguments of the same types: once."""
    return cast("Callable[P, R]", Kernel(cast("FunctionType", function), for_both=True))


def hot(kernel: Callable[P, R]) -> Callable[P, R]:
    """Say of a kernel that who calls it calls it thousands of times: it is compiled soon."""
    cast("Kernel", kernel).patience = _HOT
    return kernel
