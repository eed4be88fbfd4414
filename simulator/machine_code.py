"""Kernels as machine code: what is used of numba, imported when it is first needed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import extending, types
from numba.core import caching, sigutils

from simulator.closed import CLOSED
from simulator.compile_lock import turn
from simulator.inner_code import ClosedCompiler, InnerCompiler, rebuilt
from simulator.kernel_cache import CacheFolder, base_folder
from simulator.quick_compiler import quicken, rare_collections

__all__ = ["dispatcher", "is_none", "is_number", "overload", "unliteral"]

F = TypeVar("F", bound=Callable[..., Any])
# numba's classes carry no types, and its stubs know a part of its options
_njit: Any = numba.njit
_FunctionCache: Any = caching.FunctionCache
_CacheLocator: Any = caching._CacheLocator
_CacheImpl: Any = caching.CompileResultCacheImpl
_normalized: Any = sigutils.normalize_signature

_overload: Any = extending.overload
unliteral: Any = types.unliteral

quicken()


def overload(function: Callable[..., Any]) -> Callable[[F], F]:
    """Choose the body of a function that kernels call by the types of its arguments."""
    chosen: Callable[[F], F] = _overload(function, strict=False)
    return chosen


def is_none(kind: object) -> bool:
    """Tell whether a type is that of None."""
    return kind is types.none


def is_number(kind: object) -> bool:
    """Tell whether a type is that of a number."""
    return isinstance(kind, types.Number)


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Names files by function and line: the folder is that of exactly these sources."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._folder, self._line = folder, function.__code__.co_firstlineno

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder says it all: no times, so that a copy is as good

    def get_disambiguator(self) -> str:
        return str(self._line)


class _Impl(_CacheImpl):  # type: ignore[misc]
    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, folder)
        self._filename_base = self.get_filename_base(
            f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}", ""
        )


class _InnerImpl(_Impl):
    def rebuild(self, target_context: Any, payload: Any) -> Any:
        return rebuilt(target_context, payload)


class _Cache(_FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, in a folder that may be read-only."""

    def __init__(self, function: Callable[..., Any], folder: CacheFolder, inner: bool) -> None:
        self._writable = folder.writable
        impl = _InnerImpl if inner else _Impl
        self._impl_class = lambda one: impl(one, folder.path)
        super().__init__(function)

    def save_overload(self, signature: Any, result: Any) -> None:
        if self._writable:
            super().save_overload(signature, result)


def dispatcher(
    function: Callable[..., Any],
    folder: CacheFolder | None,
    options: dict[str, bool],
    inner: bool = False,
) -> Any:
    """Return numba's dispatcher of a function, with its machine code in a folder.

    One of an inner function answers kernels alone (`simulator.inner_code`), and one of a closed
    kernel Python alone (`simulator.closed`).

    Division by zero gives inf or nan as in numpy; the interpreter lock is released; no fast-math,
    because error-free transformations and tests for nan must survive.
    """
    hidden = {name: value for name, value in options.items() if name.startswith("_")}
    pipeline: dict[str, Any] = {"pipeline_class": ClosedCompiler} if hidden.pop(CLOSED, 0) else {}
    if inner:
        pipeline = {"no_cpython_wrapper": True, "pipeline_class": InnerCompiler}
    made = _njit(
        nogil=True,
        error_model="numpy",
        fastmath=False,
        no_cfunc_wrapper=True,  # nothing here is called from C
        **{name: value for name, value in options.items() if not name.startswith("_")},
        **pipeline,
    )(function)
    made.targetoptions.update(hidden)
    made.compile = rare_collections()(made.compile)
    if folder is not None:
        made._cache = _Cache(function, folder, inner)
        if folder.writable:
            _in_turn(made, f"{folder.path.name}/{function.__qualname__}")
    return made


def _in_turn(made: Any, name: str) -> None:
    """Let a dispatcher wait for the process that compiles the same, and load what that has kept."""
    compile_now, base = made.compile, base_folder()

    def compile_in_turn(signature: Any) -> Any:
        types_of, _ = _normalized(signature)
        if base is None or tuple(types_of) in made.overloads:
            return compile_now(signature)
        with turn(base.path, f"{name}{types_of}"):
            return compile_now(signature)

    made.compile = compile_in_turn
